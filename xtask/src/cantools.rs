//! The DBC files in `docs/` as cantools reads them; cantools is installed below the target folder.

use crate::{debian, shell, workspace};
use std::env;
use std::ffi::OsString;
use std::path::Path;

/// Works with Python 3.10 and later.
const CANTOOLS: &str = "cantools==45.1.0";

/// Decodes a frame of every message with cantools and compares with our decoder.
///
/// # Errors
/// The differences, or the command that installs what is missing.
pub fn check() -> Result<(), String> {
    let programs = workspace::programs()?;
    let tests = workspace::find(&programs, "host", "host", true)?;
    shell::run(tests.command(&["--ignored"]).env("PYTHONPATH", path()?))
}

/// `PYTHONPATH` with cantools, installed if it is missing.
///
/// # Errors
/// The command that installs what is missing.
pub fn path() -> Result<OsString, String> {
    let folder = shell::target_folder().join("cantools");
    install(&folder)?;
    let mut path = vec![folder];
    path.extend(env::var_os("PYTHONPATH").iter().flat_map(env::split_paths));
    env::join_paths(path).map_err(|error| error.to_string())
}

fn install(folder: &Path) -> Result<(), String> {
    let imports = |folder: &Path| {
        let import = ["-c", "import can, cantools"];
        shell::succeeds(shell::command("python3", &import).env("PYTHONPATH", folder))
    };
    if imports(folder) {
        return Ok(());
    }
    if !shell::succeeds(&mut shell::command("python3", &["-m", "pip", "--version"])) {
        debian::need(&["python3", "python3-pip"])
            .map_err(|install| format!("the check needs pip. On Debian:\n\n    {install}"))?;
    }
    let mut pip = shell::command("python3", &["-m", "pip", "install", "--quiet", "--target"]);
    shell::run(pip.arg(folder).arg(CANTOOLS))?;
    if imports(folder) { Ok(()) } else { Err(format!("python3 cannot import {CANTOOLS}")) }
}
