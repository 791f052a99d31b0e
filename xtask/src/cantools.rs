//! Check of the DBC files in `docs/` with cantools, which is installed below the target folder.

use crate::{python, shell, workspace};
use std::ffi::OsString;

/// Version of cantools for Python 3.10 and later.
const CANTOOLS: &str = "cantools==45.1.0";

/// Decodes a frame of every message with cantools, and compares the values with our decoder.
///
/// # Errors
/// Returns the differences. If a program is missing, the error contains the command that installs it.
pub fn check() -> Result<(), String> {
    let programs = workspace::programs()?;
    let tests = workspace::find(&programs, "host", "host", true)?;
    shell::run(tests.tests(&["--ignored"])?.env("PYTHONPATH", path()?))
}

/// Returns a `PYTHONPATH` with cantools, which is installed if it is missing.
///
/// # Errors
/// Returns the command that installs a missing program.
pub fn path() -> Result<OsString, String> {
    python::path("cantools", CANTOOLS, "can, cantools")
}
