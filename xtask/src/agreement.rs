//! Comparison of the planner's verdicts with MuJoCo, on requests that were not used for tuning the planner: `tests/agreement/`.

use crate::{mujoco, python, shell, workspace};

/// Python package with the URDF files of robots.
const ROBOTS: &str = "example-robot-data==6.0.0";
/// Folder of the robots in the installed package.
const FOLDER: &str = "robots/cmeel.prefix/share/example-robot-data/robots";
/// Number of random requests for shipped robots.
const DRAWN: &str = "60";

/// Plans and replays all requests, and prints which verdicts agree.
///
/// # Errors
/// Returns an error if more than one in forty of the accepted plans fails in MuJoCo, or if more than one in forty of the compared
/// plans is refused and passes there. If a program is missing, the error contains the command that installs it.
pub fn check() -> Result<(), String> {
    let path = mujoco::path()?;
    python::path("robots", ROBOTS, "cmeel")?;
    let rollwalk = workspace::optimised_program("cli", "rollwalk")?;
    let mut python = shell::command("python3", &["tests/agreement"]);
    python.arg(rollwalk.path).arg("-o").arg(shell::target_folder().join("agreement"));
    python.arg("--robots").arg(shell::target_folder().join(FOLDER));
    python.args(["--drawn", DRAWN, "--shipped"]);
    shell::run(python.current_dir(shell::workspace_root()).env("PYTHONPATH", path))
}
