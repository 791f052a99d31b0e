//! Robot of an image, for the build scripts of all boards.
//!
//! `cargo xtask image` and `cargo xtask board` set `ROLLWALK_ROBOT` to the path of its module, which `apps/board-bench`
//! generates from the robot file.

use std::path::Path;
use std::{env, fs, io};

/// Writes `robot.rs`, a declaration of the module `robot`, into the output directory of the build script.
///
/// # Errors
/// Returns an error if `ROLLWALK_ROBOT` is not set or the file cannot be written.
pub fn declare() -> io::Result<()> {
    println!("cargo:rerun-if-env-changed=ROLLWALK_ROBOT");
    let module = env::var("ROLLWALK_ROBOT").map_err(|_| {
        io::Error::other("ROLLWALK_ROBOT names no robot: build this image with `cargo xtask image`")
    })?;
    let out = env::var("OUT_DIR").map_err(io::Error::other)?;
    // Absolute, because the path of a module is relative to the file that declares it.
    fs::write(Path::new(&out).join("robot.rs"), format!("#[path = {module:?}]\nmod robot;\n"))
}
