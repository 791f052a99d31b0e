//! Of the build scripts of all boards: which robot an image is for. `cargo xtask image` names its module, which
//! `firmware/boards/bench` has made of the robot file, in `ROLLWALK_ROBOT`; without it, the board's default is the robot.

use std::path::Path;
use std::{env, fs, io};

/// Writes `robot.rs` into the folder of the build script's output: a declaration of the module `robot`, in the file `default`
/// of this folder unless another is named.
///
/// # Errors
/// The operating system's.
pub fn declare(default: &str) -> io::Result<()> {
    let default = || format!("{}/../{default}", env!("CARGO_MANIFEST_DIR"));
    let module = env::var("ROLLWALK_ROBOT").unwrap_or_else(|_| default());
    println!("cargo:rerun-if-env-changed=ROLLWALK_ROBOT");
    let out = env::var("OUT_DIR").map_err(io::Error::other)?;
    // Absolute, because the path of a module is relative to the file that declares it.
    fs::write(Path::new(&out).join("robot.rs"), format!("#[path = {module:?}]\nmod robot;\n"))
}
