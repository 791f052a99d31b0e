//! Import of URDF and MJCF: either, and a side file with what both lack, become the text of a robot file.
//!
//! Text in, text and warnings out. Six steps: `xml` reads the URDF, or `mjcf` a model of MuJoCo, as a `model`, `tree` makes a
//! tree of it, `side` reads the side file, `bodies` merges what is rigid, `convert` drafts the robot file and `emit` writes it.
//! The result passes every rule of robot files. [`survey`] lists the contents of a URDF and writes a first side file. Described
//! in `docs/urdf-import.md`.

mod bodies;
mod convert;
mod draft;
mod elements;
mod emit;
mod guess;
mod joints;
mod loads;
mod mjcf;
mod model;
mod motors;
mod names;
mod notes;
mod rigid;
mod scan;
mod shapes;
mod side;
mod stance;
mod survey;
mod template;
mod toml_text;
mod tree;
mod xml;

pub use survey::{Survey, SurveyEnd, SurveyJoint, survey};
pub use xml::TEXT_MAX;

use crate::document::{Document, DocumentError};
use crate::model::Robot;
use draft::Origin;
use emit::Emitted;
use notes::Notes;

/// A robot made from a URDF.
#[derive(Clone, Debug)]
pub struct Imported {
    /// The robot file.
    pub toml: String,
    /// The robot in it.
    pub robot: Robot,
    /// Changes and assumptions, each with its place.
    pub warnings: Vec<String>,
}

/// A file name and its text.
#[derive(Clone, Copy, Debug)]
pub struct Text<'t> {
    /// The name, for messages.
    pub name: &'t str,
    /// The content.
    pub text: &'t str,
}

/// Makes a robot file of a URDF with the help of a side file.
///
/// # Errors
/// All faults of the URDF or of the side file, each with its place and a help line.
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
            attribute(&error, &emitted, &mut notes, &document);
            notes.check()?;
            document.finish(None)
        }
    }
}

/// Attributes the faults of the robot file to the items of URDF and side file that they come from.
fn attribute(error: &DocumentError, emitted: &Emitted, notes: &mut Notes<'_>, side: &Document<'_>) {
    for fault in error.faults() {
        let holds =
            |(part, _): &&(std::ops::Range<usize>, Origin)| part.contains(&fault.span.start);
        let fault = fault.clone();
        match emitted.origins.iter().find(holds) {
            Some((_, Origin::Urdf(span))) => {
                notes.fault(span.clone(), fault.message, "comes from here", fault.help);
            }
            Some((_, Origin::Side(span))) => {
                side.fault(span.clone(), fault.message, "comes from here", fault.help);
            }
            // Actuators and the robot as a whole are corrected in the side file.
            None => side.fault(0..0, fault.message, "in the imported robot", fault.help),
        }
    }
}
