//! Exported robots and plans as the tools read them that they are for, from PyPI.

use crate::python::Environment;
use crate::{shell, workspace};

/// Readers of the formats: MuJoCo of MJCF and URDF, Pinocchio and a parser of URDF, a reader of MCAP.
const READERS: [&str; 4] = ["mujoco==4.0.0", "pin==4.1.0", "urdf-parser-py==0.0.4", "mcap==1.6.0"];

/// Compares poses of every shipped robot, replays motions from their exported models alone, and reads recordings.
///
/// # Errors
/// The differences, or the command that installs what is missing.
pub fn check() -> Result<(), String> {
    let python = Environment::kept("exports", &READERS)?;
    let programs = workspace::programs()?;
    let consumers = workspace::find(&programs, "interchange", "consumers", true)?;
    let mut robots = consumers.tests(&["--ignored", "--nocapture"])?;
    shell::run(robots.env("PYTHON", python.program()))?;
    let rollwalk = workspace::find(&programs, "tests", "rollwalk-under-test", false)?;
    let mut plans = python.module("unittest", &["discover", "-v", "-s", "tests/exports"]);
    shell::run(plans.env("ROLLWALK", &rollwalk.path))
}
