//! Initial inputs, which the targets generate: they are not kept as files.

use std::path::Path;

/// The variable that asks for seeds: the folder to write them to.
const FOLDER: &str = "ROLLWALK_FUZZ_SEEDS";

/// Writes the seeds and ends the program, when it was started for that.
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
