//! Robot files: TOML text to a validated [`Robot`]. The format is described in
//! `docs/robot-files.md`; `robots/agilebot.toml` is the worked example.
//!
//! [`read`] builds the robot from the tables, limbs from templates ([`group`]), and
//! [`crate::rules`] judges the result. Faults of both point into the text ([`places`]).

mod buses;
mod fields;
mod group;
pub(crate) mod parts;
mod places;
mod read;
mod shapes;

use crate::document::{Document, DocumentError};
use crate::model::Robot;
use crate::rules;

impl Robot {
    /// Reads and validates a robot file. `file_name` is for messages only.
    ///
    /// # Errors
    /// All faults of the file, each with its place and a help line. Rules of the robot are checked once
    /// the file has no other faults.
    pub fn from_toml(file_name: &str, text: &str) -> Result<Self, DocumentError> {
        let document = Document::parse(file_name, text)?;
        let robot = read::robot(&document).map(|(robot, places)| {
            for violation in rules::violations(&robot) {
                let span = places.span(violation.place, violation.field);
                document.fault(span, violation.message, "here", violation.help);
            }
            robot
        });
        document.finish(robot)
    }
}
