//! Robot files: TOML text to a validated [`Robot`]. The format is described in
//! `docs/robot-files.md`; `robots/agilebot.toml` is the worked example.
//!
//! Three steps: [`read`] turns tables into items with spans, [`assemble`] places limbs and resolves
//! names to indices, and [`crate::rules`] judges the result. Faults of all steps point into the text.

mod assemble;
mod buses;
pub(crate) mod parts;
mod read;

use crate::document::{Document, DocumentError};
use crate::model::Robot;
use crate::rules;

impl Robot {
    /// Reads and validates a robot file. `file_name` is for messages only.
    ///
    /// # Errors
    /// Everything that is wrong with the file, each fault with its place and a help line. Rules that
    /// look at the whole robot are checked once the items themselves are readable.
    pub fn from_toml(file_name: &str, text: &str) -> Result<Self, DocumentError> {
        let document = Document::parse(file_name, text)?;
        let items = read::items(&document);
        let assembled = items.and_then(|items| assemble::robot(&document, items));
        let robot = assembled.filter(|_| document.is_clean()).map(|(robot, places)| {
            for violation in rules::violations(&robot) {
                let span = places.span(violation.place, violation.field);
                document.fault(span, violation.message, "here", violation.help);
            }
            robot
        });
        document.finish(robot)
    }
}
