//! Python packages of a check, installed below the target folder. Modules are put on a path; an environment also has the
//! packages' programs.

use crate::{debian, shell};
use std::env;
use std::ffi::{OsStr, OsString};
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

/// Returns a `PYTHONPATH` with a package, which pip installs in a separate folder if it is missing. The package counts as
/// installed if `imports` can be imported.
///
/// # Errors
/// Returns the command that installs a missing program.
pub fn path(name: &str, requirement: &str, imports: &str) -> Result<OsString, String> {
    let folder = shell::target_folder().join(name);
    let import = format!("import {imports}");
    let present = || {
        let args = ["-c", import.as_str()];
        shell::succeeds(shell::command("python3", &args).env("PYTHONPATH", &folder))
    };
    if !present() {
        if !shell::succeeds(&mut shell::command("python3", &["-m", "pip", "--version"])) {
            debian::need(&["python3", "python3-pip"]).map_err(|install| {
                format!("the check requires pip. On Debian:\n\n    {install}")
            })?;
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

/// Python environment that contains only its own packages.
pub struct Environment(PathBuf);

impl Environment {
    /// Creates the environment in a new folder, with the given packages (names with versions, or files) and their dependencies.
    ///
    /// # Errors
    /// Returns pip's error. If a program is missing, the error contains the command that installs it.
    pub fn new(folder: &Path, packages: &[&OsStr]) -> Result<Self, String> {
        let mut venv = shell::command("python3", &["-m", "venv", "--clear"]);
        venv.arg(folder);
        if !shell::succeeds(&mut venv) {
            debian::need(&["python3-venv"]).map_err(|install| {
                format!("the check requires Python's venv. On Debian:\n\n    {install}")
            })?;
            shell::run(&mut venv)?;
        }
        let python = Self(folder.to_owned());
        let _alone = shell::installing()?;
        let mut pip = python.module("pip", &["install", "--quiet", "--disable-pip-version-check"]);
        shell::run(pip.args(packages))?;
        Ok(python)
    }

    /// Returns an environment with the given packages below the target folder, reusing that of an earlier run.
    ///
    /// # Errors
    /// Returns the errors of [`new`](Self::new).
    pub fn kept(name: &str, packages: &[&str]) -> Result<Self, String> {
        let folder = shell::target_folder().join(name);
        // Written last, so that an interrupted folder is created again.
        let (made, wanted) = (folder.join("packages.txt"), packages.join("\n"));
        if fs::read_to_string(&made).is_ok_and(|there| there == wanted) {
            return Ok(Self(folder));
        }
        let packages: Vec<_> = packages.iter().map(OsStr::new).collect();
        let python = Self::new(&folder, &packages)?;
        fs::write(&made, wanted).map_err(|error| format!("{}: {error}", made.display()))?;
        Ok(python)
    }

    pub fn program(&self) -> PathBuf {
        self.script("python")
    }

    /// Path of a program that a package of the environment installed, such as `colcon`.
    pub fn script(&self, name: &str) -> PathBuf {
        self.0.join("bin").join(name)
    }

    /// Creates a command that runs a module with arguments; only the packages of this environment are found.
    pub fn module(&self, name: &str, args: &[&str]) -> Command {
        let mut command = shell::command(&self.program().to_string_lossy(), &["-m", name]);
        command.args(args).env_remove("PYTHONPATH");
        command
    }
}
