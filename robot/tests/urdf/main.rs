//! URDF import, from outside: what a robot weighs and where its parts are, against a computation of its
//! own; every trap of URDF; hostile input.

mod faults;
mod hostile;
mod large;
mod mjcf;
mod oracle;
mod physics;
mod repairs;
mod shapes;
mod surveys;

use rollwalk_robot::document::DocumentError;
use rollwalk_robot::urdf::{Imported, Text, import};

/// The robot that the tests take apart.
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

/// `text` with its only `from` replaced.
#[track_caller]
fn edited(text: &str, from: &str, to: &str) -> String {
    assert_eq!(text.matches(from).count(), 1, "{from:?} is to be there once");
    text.replace(from, to)
}
