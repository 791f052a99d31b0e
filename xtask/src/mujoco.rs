//! Kinematics and dynamics of every robot file against MuJoCo, which is installed below the target folder.

use crate::extent::Extent;
use crate::{python, shell, workspace};
use std::ffi::OsString;

/// Works with Python 3.10 and later.
const MUJOCO: &str = "mujoco==4.0.0";

/// Compares `rollwalk-multibody` with MuJoCo on random states of each robot: 5, 50 or 1,000.
///
/// # Errors
/// The differences, or the command that installs what is missing.
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

/// `PYTHONPATH` with MuJoCo, installed if it is missing.
///
/// # Errors
/// The command that installs what is missing.
pub fn path() -> Result<OsString, String> {
    python::path("mujoco", MUJOCO, "mujoco, numpy")
}
