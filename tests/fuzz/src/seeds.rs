//! Initial inputs. The targets generate them, so they are not stored as files.

use std::path::Path;

/// Environment variable with the folder to write seeds to.
const FOLDER: &str = "ROLLWALK_FUZZ_SEEDS";

/// Writes the seeds and exits, if the environment variable is set.
pub fn write_if_asked(seeds: fn() -> Vec<Vec<u8>>) {
    let Some(folder) = std::env::var_os(FOLDER) else { return };
    for (number, seed) in seeds().iter().enumerate() {
        let path = Path::new(&folder).join(format!("seed-{number:03}"));
        if let Err(error) = std::fs::write(&path, seed) {
            eprintln!("{}: {error}", path.display());
            std::process::exit(1);
        }
    }
    std::process::exit(0);
}
