//! Comparison of every robot file's kinematics and dynamics with MuJoCo, which is installed below the target folder.

use crate::extent::Extent;
use crate::{python, shell, workspace};
use std::ffi::OsString;

/// Version of MuJoCo for Python 3.10 and later.
const MUJOCO: &str = "mujoco==4.0.0";

/// Compares `rollwalk-multibody` with MuJoCo on 5, 50 or 1,000 random states of each robot.
///
/// # Errors
/// Returns the differences. If a program is missing, the error contains the command that installs it.
pub fn check(extent: Extent) -> Result<(), String> {
    let states = match extent {
        Extent::Brief => "5",
        Extent::Short => "50",
        Extent::Full => "1000",
    };
    let programs = workspace::programs()?;
    let tests = workspace::find(&programs, "robot/multibody", "multibody", true)?;
    let path = path()?;
    let mut command = tests.tests(&["--ignored", "--nocapture"])?;
    shell::run(command.env("PYTHONPATH", path).env("MULTIBODY_STATES", states))
}

/// Returns a `PYTHONPATH` with MuJoCo, which is installed if it is missing.
///
/// # Errors
/// Returns the command that installs a missing program.
pub fn path() -> Result<OsString, String> {
    python::path("mujoco", MUJOCO, "mujoco, numpy")
}
