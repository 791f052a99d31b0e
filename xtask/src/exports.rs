//! Check of exported robots and plans with the tools that they are meant for, installed from PyPI.

use crate::extent::Extent;
use crate::python::Environment;
use crate::{mujoco, shell, workspace};

/// Python packages that read the formats: MuJoCo for MJCF and URDF, Pinocchio and a URDF parser, and an MCAP reader.
const READERS: [&str; 4] = ["mujoco==4.0.0", "pin==4.1.0", "urdf-parser-py==0.0.4", "mcap==1.6.0"];

/// Test that needs no reader but MuJoCo.
const IMPORTED: &str = "an_imported_model_has_the_poses_of_mujoco";

/// Compares poses of every shipped robot, replays motions from their exported models alone, and reads recordings. The brief
/// form compares the poses of one imported robot in MuJoCo.
///
/// # Errors
/// Returns the differences. If a program is missing, the error contains the command that installs it.
pub fn check(extent: Extent) -> Result<(), String> {
    if extent == Extent::Brief {
        let programs = workspace::programs()?;
        let consumers = workspace::find(&programs, "planner/interchange", "consumers", true)?;
        let mut imported = consumers.tests(&[IMPORTED, "--ignored", "--nocapture"])?;
        return shell::run(imported.env("PYTHONPATH", mujoco::path()?));
    }
    let python = Environment::kept("exports", &READERS)?;
    let programs = workspace::programs()?;
    let consumers = workspace::find(&programs, "planner/interchange", "consumers", true)?;
    let mut robots = consumers.tests(&["--ignored", "--nocapture"])?;
    shell::run(robots.env("PYTHON", python.program()))?;
    let rollwalk = workspace::find(&programs, "tests", "rollwalk-under-test", false)?;
    let mut plans = python.module("unittest", &["discover", "-v", "-s", "tests/exports"]);
    shell::run(plans.env("ROLLWALK", &rollwalk.path))
}
