//! Reader of robot files, from TOML text to a validated [`Robot`]. `docs/robot-files.md` describes the format, and
//! `robots/agilebot.toml` is the worked example.
//!
//! [`read`] builds the robot from the tables, with limbs from templates ([`group`]). [`crate::rules`] checks the result. Faults
//! of both have spans in the text ([`item_tables`]).

mod buses;
mod fields;
mod group;
mod item_tables;
pub(crate) mod parts;
mod prismatic;
mod read;
mod shapes;
mod sides;

use crate::document::{Document, DocumentError};
use crate::model::Robot;
use crate::rules;
use crate::solid::Solid;

impl Robot {
    /// Parses and validates a robot file. `file_name` appears in messages only.
    ///
    /// # Errors
    /// Returns all faults of the file, each with its location and a help text. Rules of the robot are checked only if the file
    /// has no other faults.
    pub fn from_toml(file_name: &str, text: &str) -> Result<Self, DocumentError> {
        Ok(Self::with_parts_from_toml(file_name, text)?.0)
    }

    /// Parses a robot file like [`from_toml`](Self::from_toml), and also returns the parts of each link, in the robot's order.
    /// Parts serve for display only.
    ///
    /// # Errors
    /// Returns the errors of [`from_toml`](Self::from_toml).
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
