//! Recordings of all kinds, read.

use crate::files;
use crate::kind::Kind;
use miette::miette;
use rollwalk_robot::Robot;
use rollwalk_simulate::identify::Recording;
use rollwalk_simulate::log::Table;
use std::path::Path;

/// Reads the run of a robot.
///
/// # Errors
/// The file cannot be read, or lacks a column that a fit needs.
pub fn read(path: &Path, robot: &Robot) -> miette::Result<Recording> {
    let help = "docs/identification.md names the columns; `rollwalk simulate PLAN.json --world-log RUN.csv` writes all of them";
    let text = files::read_text(path, Kind::WorldLog)?;
    let failed =
        |error: &dyn std::fmt::Display| miette!(help = help, "{}: {error}", path.display());
    let table = Table::read_some(&text).map_err(|error| failed(&error))?;
    Recording::from_table(&table, robot).map_err(|error| failed(&error))
}
