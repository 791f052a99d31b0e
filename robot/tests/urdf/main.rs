//! Integration tests of the URDF import: masses and geometry against an independent computation, pitfalls of URDF, malicious
//! input.

mod ends;
mod faults;
mod hostile;
mod large;
mod made;
mod mjcf;
mod oracle;
mod physics;
mod repairs;
mod shapes;
mod slides;
mod stances;
mod surveys;

use rollwalk_robot::document::DocumentError;
use rollwalk_robot::urdf::{Imported, Text, import};

/// URDF of the robot for the tests.
const URDF: &str = include_str!("rover.urdf");
const SIDE: &str = include_str!("rover.side.toml");

fn imported(urdf: &str, side: &str) -> Result<Imported, DocumentError> {
    import(Text { name: "rover.urdf", text: urdf }, Text { name: "rover.side.toml", text: side })
}

#[track_caller]
fn good(urdf: &str, side: &str) -> Imported {
    imported(urdf, side).unwrap_or_else(|error| {
        panic!("{error}\n{:?}", miette::Report::new(error.clone()));
    })
}

/// Replaces the only occurrence of `from` in `text`.
#[track_caller]
fn edited(text: &str, from: &str, to: &str) -> String {
    assert_eq!(text.matches(from).count(), 1, "{from:?} is to be there once");
    text.replace(from, to)
}
