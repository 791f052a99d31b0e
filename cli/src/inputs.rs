//! Input files to validated values, with one hint for each kind of file.

use crate::files;
use miette::Report;
use rollwalk_planner::plan::Plan;
use rollwalk_robot::Robot;
use std::path::Path;

/// Reads and validates a robot file.
///
/// # Errors
/// The file is missing, or everything that is wrong in it.
pub fn robot(path: &Path) -> miette::Result<Robot> {
    let hint = "give the path of a robot file, such as robots/agilebot.toml";
    let text = files::read_text(path, "robot file (TOML)", hint)?;
    Robot::from_toml(&path.to_string_lossy(), &text).map_err(Report::new)
}

/// Reads and validates a plan.
///
/// # Errors
/// The file is missing or is not a plan that this version reads.
pub fn plan(path: &Path) -> miette::Result<Plan> {
    let hint = "make one with `rollwalk plan MOTION.toml -o PLAN.json`";
    let text = files::read_text(path, "plan (JSON)", hint)?;
    Plan::from_json(&path.to_string_lossy(), &text).map_err(Report::new)
}
