//! Check of the Python package. Its wheel is built by maturin and installed in a separate environment, in which its tests and
//! tutorial run and its type stubs are compared with it.

use crate::python::Environment;
use crate::{shell, workspace};
use std::fs;
use std::path::{Path, PathBuf};

/// Version of maturin, as in `apps/python/pyproject.toml`.
const MATURIN: &str = "maturin==1.16.0";
/// Version of mypy, whose `stubtest` compares type stubs with the package.
const MYPY: &str = "mypy==2.4.1";

/// Builds the wheel, installs it, and compares it with the command line.
///
/// # Errors
/// Returns an error if the build or a test fails. If a program is missing, the error contains the command that installs it.
pub fn check() -> Result<(), String> {
    let folder = shell::target_folder().join("wheel");
    let maturin = Environment::new(&folder.join("maturin"), &[MATURIN.as_ref()])?;
    let wheel = build(&maturin, &folder.join("dist"))?;
    let python = Environment::new(&folder.join("python"), &[MYPY.as_ref(), wheel.as_ref()])?;
    let rollwalk = workspace::optimised_program("tests", "rollwalk-under-test")?;
    let mut tests = python.module("unittest", &["discover", "-v", "-s", "apps/python/tests"]);
    shell::run(tests.env("ROLLWALK", &rollwalk.path))?;
    shell::run(&mut python.module("mypy.stubtest", &["rollwalk"]))
}

/// Builds the wheel and returns its path; it is the only file of a folder.
fn build(maturin: &Environment, dist: &Path) -> Result<PathBuf, String> {
    let failed = |error: std::io::Error| format!("{}: {error}", dist.display());
    if dist.exists() {
        fs::remove_dir_all(dist).map_err(failed)?;
    }
    let build = ["build", "--release", "--locked", "-m", "apps/python/Cargo.toml", "--out"];
    shell::run(maturin.module("maturin", &build).arg(dist))?;
    let mut files = fs::read_dir(dist).map_err(failed)?.filter_map(Result::ok);
    let wheel = files.find(|file| file.path().extension().is_some_and(|ending| ending == "whl"));
    wheel
        .map(|file| file.path())
        .ok_or_else(|| format!("maturin wrote no wheel into {}", dist.display()))
}
