//! Input files to validated values, with one hint for each kind of file.
//!
//! Motion and library files name other files relative to themselves. They come from the disk or from
//! the binary, which carries the shipped robots and motions so that the demo runs in any folder.

use crate::{files, shipped};
use miette::Report;
use rollwalk_planner::plan::Plan;
use rollwalk_robot::Robot;
use std::path::Path;

/// Where input files come from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Source {
    /// The file system.
    Disk,
    /// The files inside the binary, by their path in the checkout.
    Shipped,
}

impl Source {
    /// Reads and validates a robot file.
    ///
    /// # Errors
    /// The file is missing, or everything that is wrong in it.
    pub fn robot(self, path: &Path) -> miette::Result<Robot> {
        let hint = "give the path of a robot file, such as robots/agilebot.toml";
        let text = self.text(path, "robot file (TOML)", hint)?;
        Robot::from_toml(&path.to_string_lossy(), &text).map_err(Report::new)
    }

    fn text(self, path: &Path, kind: &'static str, hint: &str) -> miette::Result<String> {
        match self {
            Source::Disk => files::read_text(path, kind, hint),
            Source::Shipped => shipped::text(path).map(str::to_owned).ok_or_else(|| {
                miette::miette!("the binary carries no {kind} called {}", path.display())
            }),
        }
    }
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
