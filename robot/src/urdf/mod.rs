//! Import of URDF and MJCF: a model and a side file become the text of a robot file (`docs/urdf-import.md`).
//!
//! [`import`] has six steps. `xml` reads a URDF, or `mjcf` a model of MuJoCo, as a `model`. `tree` makes a tree of it, `side`
//! reads the side file, `bodies` merges rigid parts, `convert` drafts the robot file and `emit` writes it. The result passes
//! every rule of robot files.
//!
//! [`survey`] lists the contents of a model and proposes a side file: `draft_side` collects the guesses of `guess`, `stance`
//! finds a standing pose, `remarks` warns and `template` writes.

mod attribution;
mod bodies;
mod convert;
mod draft;
mod draft_side;
mod dropped;
mod elements;
mod emit;
mod guess;
mod joints;
mod linkages;
mod loads;
mod mjcf;
mod model;
mod motors;
mod names;
mod notes;
mod remarks;
mod rigid;
mod scan;
mod shapes;
mod side;
mod stance;
mod survey;
mod template;
mod toml_text;
mod transmissions;
mod tree;
mod xml;

pub use emit::is_unchanged;
pub use survey::{Survey, SurveyEnd, SurveyJoint, survey, survey_with};
pub use xml::TEXT_MAX;

use crate::document::{Document, DocumentError};
use crate::model::Robot;
use notes::Notes;

/// Robot from a URDF.
#[derive(Clone, Debug)]
pub struct Imported {
    /// Text of the robot file.
    pub toml: String,
    /// Robot of this file.
    pub robot: Robot,
    /// Warnings about changes and assumptions, each with its location.
    pub warnings: Vec<String>,
}

/// File name and text.
#[derive(Clone, Copy, Debug)]
pub struct Text<'t> {
    /// Name in messages.
    pub name: &'t str,
    /// Content.
    pub text: &'t str,
}

/// Converts a URDF and a side file to a robot file.
///
/// # Errors
/// All faults of the URDF or of the side file, each with its location and a help line.
pub fn import(urdf: Text<'_>, side: Text<'_>) -> Result<Imported, DocumentError> {
    let text = xml::checked(urdf.name, urdf.text)?;
    let mut notes = Notes::new(urdf.name, &text);
    let read = xml::read(&mut notes)?;
    let graph = tree::graph(&read, &mut notes);
    notes.check()?;
    let document = Document::parse(side.name, side.text)?;
    let read_side = side::read(&document);
    let draft = graph
        .zip(read_side)
        .and_then(|(graph, side)| convert::convert(&read, &graph, &side, &document, &mut notes));
    notes.check()?;
    let Some(draft) = draft else { return document.finish(None) };
    let emitted = emit::emit(&draft, [urdf.name, side.name]);
    match Robot::from_toml("the imported robot", &emitted.text) {
        Ok(robot) => Ok(Imported { toml: emitted.text, robot, warnings: notes.warnings }),
        Err(error) => {
            attribution::attribute(&error, &emitted, &mut notes, &document);
            notes.check()?;
            document.finish(None)
        }
    }
}
