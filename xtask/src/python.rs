//! Python packages that a check needs, installed below the target folder for that check alone.

use crate::{debian, shell};
use std::env;
use std::ffi::OsString;

/// `PYTHONPATH` with a package, which pip installs in a folder of its own if it is missing. `imports` are the
/// modules that show that it is there.
///
/// # Errors
/// The command that installs what is missing.
pub fn path(name: &str, requirement: &str, imports: &str) -> Result<OsString, String> {
    let folder = shell::target_folder().join(name);
    let import = format!("import {imports}");
    let present = || {
        let args = ["-c", import.as_str()];
        shell::succeeds(shell::command("python3", &args).env("PYTHONPATH", &folder))
    };
    if !present() {
        if !shell::succeeds(&mut shell::command("python3", &["-m", "pip", "--version"])) {
            debian::need(&["python3", "python3-pip"])
                .map_err(|install| format!("the check needs pip. On Debian:\n\n    {install}"))?;
        }
        let _alone = shell::installing()?;
        let mut pip = shell::command("python3", &["-m", "pip", "install", "--quiet", "--target"]);
        if !present() {
            shell::run(pip.arg(&folder).arg(requirement))?;
        }
        if !present() {
            return Err(format!("python3 cannot import {requirement}"));
        }
    }
    let mut path = vec![folder];
    path.extend(env::var_os("PYTHONPATH").iter().flat_map(env::split_paths));
    env::join_paths(path).map_err(|error| error.to_string())
}
