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
mod sides;

use crate::document::{Document, DocumentError};
use crate::model::Robot;
use crate::rules;
use crate::solid::Solid;

impl Robot {
    /// Reads and validates a robot file. `file_name` is for messages only.
    ///
    /// # Errors
    /// All faults of the file, each with its place and a help line. Rules of the robot are checked once
    /// the file has no other faults.
    pub fn from_toml(file_name: &str, text: &str) -> Result<Self, DocumentError> {
        Ok(Self::with_parts_from_toml(file_name, text)?.0)
    }

    /// Reads a robot file like [`from_toml`](Self::from_toml), and returns the parts of every link as well, in the robot's order.
    /// Parts describe the look of the robot; nothing computes with them.
    ///
    /// # Errors
    /// As [`from_toml`](Self::from_toml).
    pub fn with_parts_from_toml(
        file_name: &str,
        text: &str,
    ) -> Result<(Self, Vec<Vec<Solid>>), DocumentError> {
        let document = Document::parse(file_name, text)?;
        let robot = read::robot(&document).map(|(robot, parts, places)| {
            for violation in rules::violations(&robot) {
                let span = places.span(violation.place, violation.field);
                document.fault(span, violation.message, "here", violation.help);
            }
            (robot, parts)
        });
        document.finish(robot)
    }
}
