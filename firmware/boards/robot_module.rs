//! Of the build scripts of all boards: which robot an image is for. `cargo xtask image` names its module, which
//! `firmware/boards/bench` has made of the robot file, in `ROLLWALK_ROBOT`; without it, AgileBot is the robot.

use std::path::Path;
use std::{env, fs, io};

/// Writes `robot.rs` into the folder of the build script's output: a declaration of the module `robot`.
///
/// # Errors
/// The operating system's.
pub fn declare() -> io::Result<()> {
    let default = concat!(env!("CARGO_MANIFEST_DIR"), "/../agilebot.rs");
    let module = env::var("ROLLWALK_ROBOT").unwrap_or_else(|_| default.into());
    println!("cargo:rerun-if-env-changed=ROLLWALK_ROBOT");
    let out = env::var("OUT_DIR").map_err(io::Error::other)?;
    // Absolute, because the path of a module is relative to the file that declares it.
    fs::write(Path::new(&out).join("robot.rs"), format!("#[path = {module:?}]\nmod robot;\n"))
}
