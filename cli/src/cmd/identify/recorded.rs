//! Recordings of all kinds, read.

use crate::files;
use crate::kind::Kind;
use miette::miette;
use rollwalk_robot::Robot;
use rollwalk_simulate::identify::{Recording, Wanted};
use std::path::Path;

/// Reads the run of a robot.
///
/// # Errors
/// The file cannot be read, or lacks a column that a fit needs.
pub fn read(path: &Path, robot: &Robot, wanted_s: Wanted) -> miette::Result<Recording> {
    let help = "docs/identification.md names the columns; `rollwalk simulate PLAN.json --world-log RUN.csv` writes all of them";
    let text = files::read_text(path, Kind::WorldLog)?;
    Recording::from_text(&text, robot, wanted_s)
        .map_err(|error| miette!(help = help, "{}: {error}", path.display()))
}
