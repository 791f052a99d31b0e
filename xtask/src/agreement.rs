//! Verdicts of the planner on requests outside those that the planner was tuned on, against MuJoCo: `tests/agreement/`.

use crate::{mujoco, python, shell, workspace};

/// Robots with URDF files.
const ROBOTS: &str = "example-robot-data==6.0.0";
/// Folder of the robots in what pip installs.
const FOLDER: &str = "robots/cmeel.prefix/share/example-robot-data/robots";
/// Random requests of shipped robots.
const DRAWN: &str = "60";

/// Plans and replays all requests; prints which verdicts agree.
///
/// # Errors
/// More than one wrong verdict in forty, or the command that installs what is missing.
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
