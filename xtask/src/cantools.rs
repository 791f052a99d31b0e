//! The DBC files in `docs/` as cantools reads them; cantools is installed below the target folder.

use crate::{python, shell, workspace};
use std::ffi::OsString;

/// Works with Python 3.10 and later.
const CANTOOLS: &str = "cantools==45.1.0";

/// Decodes a frame of every message with cantools and compares with our decoder.
///
/// # Errors
/// The differences, or the command that installs what is missing.
pub fn check() -> Result<(), String> {
    let programs = workspace::programs()?;
    let tests = workspace::find(&programs, "host", "host", true)?;
    shell::run(tests.tests(&["--ignored"])?.env("PYTHONPATH", path()?))
}

/// `PYTHONPATH` with cantools, installed if it is missing.
///
/// # Errors
/// The command that installs what is missing.
pub fn path() -> Result<OsString, String> {
    python::path("cantools", CANTOOLS, "can, cantools")
}
