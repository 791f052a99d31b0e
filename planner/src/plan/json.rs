//! Plans as JSON text: one writer, one reader, and what the reader says about a bad file.
//!
//! Every field with its unit and frame: `docs/plan-format.md`. The writer is deterministic: the same plan
//! gives the same bytes. Arrays of plain values stay on one line, so that a plan can be read and diffed.

use super::{FORMAT, Plan, VERSION};
use miette::Diagnostic;
use serde::Deserialize;
use thiserror::Error;

/// Why a plan file cannot be used.
#[derive(Clone, Debug, PartialEq, Eq, Error, Diagnostic)]
pub enum PlanError {
    /// The text is not JSON, or a field is missing or of the wrong type.
    #[error("{file}:{line}:{column}: {path}: {message}")]
    #[diagnostic(help("docs/plan-format.md lists every field; `rollwalk plan` writes such files"))]
    Syntax {
        /// The file as the caller named it.
        file: String,
        /// Line of the trouble, from 1.
        line: usize,
        /// Column of the trouble, from 1.
        column: usize,
        /// JSON path of the field, such as `samples[3].com_m`; `.` is the whole file.
        path: String,
        /// What is wrong.
        message: String,
    },
    /// A field has a value that no plan can have.
    #[error("{file}: {path} is {value}; expected {expected}")]
    #[diagnostic(help("docs/plan-format.md lists every field with its unit and frame"))]
    Value {
        /// The file as the caller named it.
        file: String,
        /// JSON path of the field.
        path: String,
        /// The value found.
        value: String,
        /// What would be right.
        expected: String,
    },
}

impl Plan {
    /// This plan as readable JSON, ending in a newline.
    pub fn to_json(&self) -> String {
        // Only maps with non-string keys can fail to become JSON; a plan has no map.
        let pretty = serde_json::to_string_pretty(self).unwrap_or_default();
        let mut text = join_plain_arrays(&pretty);
        text.push('\n');
        text
    }

    /// Reads a plan and checks that it is whole and consistent. `file` is how errors name the text.
    ///
    /// # Errors
    /// [`PlanError`] names file, field, value and what would be right.
    pub fn from_json(file: &str, text: &str) -> Result<Self, PlanError> {
        let syntax = |path: String, error: &serde_json::Error| PlanError::Syntax {
            file: file.to_owned(),
            line: error.line(),
            column: error.column(),
            path,
            message: without_position(error),
        };
        // Format and version first: a plan of another version may differ in any other field.
        let header: Header =
            serde_json::from_str(text).map_err(|error| syntax(".".to_owned(), &error))?;
        header.check(file)?;
        let mut deserializer = serde_json::Deserializer::from_str(text);
        let plan: Self = serde_path_to_error::deserialize(&mut deserializer)
            .map_err(|error| syntax(error.path().to_string(), error.inner()))?;
        plan.validate(file)?;
        Ok(plan)
    }
}

/// The two fields that every version of the format has.
#[derive(Deserialize)]
struct Header {
    #[serde(default)]
    format: serde_json::Value,
    #[serde(default)]
    version: serde_json::Value,
}

impl Header {
    fn check(&self, file: &str) -> Result<(), PlanError> {
        let fault = |path: &str, value: &serde_json::Value, expected: String| PlanError::Value {
            file: file.to_owned(),
            path: path.to_owned(),
            value: if value.is_null() { "missing".to_owned() } else { value.to_string() },
            expected,
        };
        if self.format.as_str() != Some(FORMAT) {
            return Err(fault("format", &self.format, format!("\"{FORMAT}\"")));
        }
        match self.version.as_u64() {
            Some(version) if version == u64::from(VERSION) => Ok(()),
            Some(version) if version > u64::from(VERSION) => {
                let expected = format!(
                    "{VERSION} or less: the plan is from a newer rollwalk, update this one"
                );
                Err(fault("version", &self.version, expected))
            }
            _ => Err(fault("version", &self.version, format!("{VERSION}"))),
        }
    }
}

/// The message without serde_json's trailing position, which the error carries as fields.
fn without_position(error: &serde_json::Error) -> String {
    let message = error.to_string();
    message.rsplit_once(" at line ").map_or(message.clone(), |(head, _)| head.to_owned())
}

/// Puts every array that holds no array and no object on one line.
fn join_plain_arrays(pretty: &str) -> String {
    let mut out = String::with_capacity(pretty.len());
    let mut rest = pretty;
    while let Some(open) = find_outside_strings(rest, |c| c == '[') {
        let (head, tail) = rest.split_at(open);
        out.push_str(head);
        let inside = &tail[1..];
        let end = find_outside_strings(inside, |c| matches!(c, '[' | '{' | ']'));
        match end {
            Some(end) if inside[end..].starts_with(']') => {
                let items: Vec<&str> =
                    inside[..end].lines().map(str::trim).filter(|l| !l.is_empty()).collect();
                out.push('[');
                out.push_str(&items.join(" "));
                out.push(']');
                rest = &inside[end + 1..];
            }
            _ => {
                out.push('[');
                rest = inside;
            }
        }
    }
    out.push_str(rest);
    out
}

/// Byte offset of the first character outside JSON strings that `wanted` accepts.
fn find_outside_strings(text: &str, wanted: impl Fn(char) -> bool) -> Option<usize> {
    let mut in_string = false;
    let mut escaped = false;
    for (offset, c) in text.char_indices() {
        match c {
            _ if escaped => escaped = false,
            '\\' if in_string => escaped = true,
            '"' => in_string = !in_string,
            _ if !in_string && wanted(c) => return Some(offset),
            _ => {}
        }
    }
    None
}
