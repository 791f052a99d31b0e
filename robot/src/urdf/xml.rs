//! Reader of the XML text of a URDF or MJCF file. It ignores mesh files, and elements without mass, geometry or joints.
//!
//! Crate `urdf-rs` reports a single error without its position, accepts NaN, and cannot distinguish an absent limit from 0.

use super::dropped;
use super::elements::Reader;
use super::joints::in_degrees;
use super::mjcf;
use super::model::{ITEMS_MAX, Urdf};
use super::notes::Notes;
use super::scan::scan;
use super::transmissions;
use crate::document::{DocumentError, Fault};
use roxmltree::{Document, Error, Node, ParsingOptions};

/// Maximum length of the text, bytes. Files of real robots are far smaller, because meshes are separate files.
pub const TEXT_MAX: usize = 16 << 20;
/// Maximum number of nodes of the XML tree.
const NODES_MAX: u32 = 1 << 18;
/// Namespace of undeclared prefixes.
const UNDECLARED: &str = "urn:undeclared";

fn parse(text: &str) -> Result<Document<'_>, Error> {
    Document::parse_with_options(
        text,
        ParsingOptions { nodes_limit: NODES_MAX, ..Default::default() },
    )
}

/// Bounds the parser's time and memory, and declares all prefixes, because other URDF readers accept undeclared ones. Keeps
/// line numbers.
pub(super) fn checked(file_name: &str, text: &str) -> Result<String, DocumentError> {
    if text.len() > TEXT_MAX {
        let message = format!("the file has {} bytes", text.len());
        let help =
            format!("put meshes into files of their own: a URDF file has at most {TEXT_MAX}");
        let fault = Fault::new(text, 0..0, message, "too large", help);
        // A fault with the text would print the whole text.
        return Err(DocumentError::of(file_name, "", vec![fault]).expect("one fault"));
    }
    let found = scan(text)
        .map_err(|fault| DocumentError::of(file_name, text, vec![fault]).expect("one fault"))?;
    let mut declared = text.to_owned();
    if let Some(at) = found.after_robot {
        let declare = |prefix: &&str| format!(" xmlns:{prefix}=\"{UNDECLARED}\"");
        declared.insert_str(at, &found.prefixes.iter().map(declare).collect::<String>());
    }
    Ok(declared)
}

/// Reads the text of `notes`.
pub(super) fn read(notes: &mut Notes<'_>) -> Result<Urdf, DocumentError> {
    let text = notes.text;
    let document = match parse(text) {
        Ok(document) => document,
        Err(error) => {
            syntax_fault(notes, &error);
            notes.check()?;
            return Ok(Urdf::default());
        }
    };
    let root = document.root_element();
    if root.has_tag_name("mujoco") {
        return mjcf::read(root, notes);
    }
    let mut reader = Reader { notes };
    if root.tag_name().name() != "robot" {
        let name = root.tag_name().name();
        let help = match name {
            "sdf" | "world" | "model" => {
                "this is SDF: convert it to MJCF with `sdf2mjcf robot.sdf robot.xml` (Python package \
                 sdformat-mjcf)"
            }
            _ => "give a URDF file, with one root element <robot name=\"…\">",
        };
        reader.fault(root, format!("the root element is <{name}>, not <robot>"), help);
    } else if let Some(macros) = root.descendants().find(|node| is_xacro(*node)) {
        reader.xacro(macros);
    }
    for kind in ["link", "joint"] {
        let count = root.children().filter(|node| node.has_tag_name(kind)).count();
        if count > ITEMS_MAX {
            let message = format!("the robot has {count} <{kind}> elements");
            let help = format!("check the path: the import reads at most {ITEMS_MAX}");
            reader.fault(root, message, &help);
        }
    }
    reader.notes.check()?;
    let mut urdf =
        Urdf { name: root.attribute("name").unwrap_or("robot").to_owned(), ..Urdf::default() };
    for node in root.children().filter(|node| node.tag_name().namespace().is_none()) {
        match node.tag_name().name() {
            "link" => urdf.links.extend(reader.link(node)),
            "joint" => urdf.joints.extend(reader.joint(node)),
            _ => {}
        }
    }
    urdf.in_degrees = in_degrees(&urdf.joints);
    reader.notes.check()?;
    transmissions::couple(root, &mut urdf, reader.notes);
    dropped::warn(root, reader.notes);
    if urdf.links.is_empty() {
        reader.fault(root, "the robot has no <link>", "give at least one link with an <inertial>");
    }
    reader.notes.check()?;
    Ok(urdf)
}

/// True for a macro or its call. Expanded files still declare the prefix.
fn is_xacro(node: Node<'_, '_>) -> bool {
    let prefix = node.is_element() && {
        let written = &node.document().input_text()[node.range()];
        written.starts_with("<xacro:")
    };
    prefix || node.tag_name().namespace().is_some_and(|uri| uri.ends_with("/xacro"))
}

fn syntax_fault(notes: &mut Notes<'_>, error: &Error) {
    let position = error.pos();
    let mut lines = notes.text.split_inclusive('\n');
    let before: usize = lines.by_ref().take(position.row as usize - 1).map(str::len).sum();
    let line = lines.next().unwrap_or_default();
    let column = line.char_indices().nth(position.col as usize - 1).map_or(0, |(at, _)| at);
    let mut at = (before + column).min(notes.text.len());
    let (message, help) = match error {
        Error::UnclosedRootNode | Error::UnexpectedEndOfStream => {
            at = notes.text.trim_end().len();
            (
                "this is not XML: the file ends inside an element".to_owned(),
                "complete the file: a URDF ends with </robot>, a model of MuJoCo with </mujoco>"
                    .to_owned(),
            )
        }
        Error::DtdDetected => (
            "the file has a document type declaration (<!DOCTYPE …>)".to_owned(),
            "remove the declaration, and write its entities out".to_owned(),
        ),
        Error::NodesLimitReached => (
            format!("the file has more than {NODES_MAX} XML nodes"),
            "check the path: a robot has a few thousand nodes".to_owned(),
        ),
        _ => (
            format!("this is not XML: {error}"),
            "give a URDF file: XML that begins with <robot name=\"…\">".to_owned(),
        ),
    };
    notes.fault(at..at, message, "here", help);
}
