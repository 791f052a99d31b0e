//! Problem files: all inputs of a solve in one file, for bug reports (docs/problem-files.md).
//!
//! Problem files contain the original texts of the input files. A replay uses the same parsers, and gives the same plan to the
//! byte.

use crate::choices::Choices;
use crate::files::FileError;
use crate::inputs::{MotionTexts, TextFile};
use crate::kind::{Kind, PROBLEM_FORMAT};
use rollwalk_planner::json::{Format, JsonError};
use rollwalk_planner::motion::Motion;
use rollwalk_planner::plan::Plan;
use rollwalk_robot::Robot;
use serde::{Deserialize, Serialize};
use std::path::Path;

/// Version of the format that this program writes and reads.
const VERSION: u32 = 1;
const PROGRAM: &str = concat!("rollwalk ", env!("CARGO_PKG_VERSION"));

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Problem {
    format: String,
    version: u32,
    /// Program that wrote the file.
    program: String,
    pub options: Choices,
    motion: TextFile,
    /// Text of the robot file.
    pub robot: TextFile,
    /// Plan used as the starting point.
    from: Option<TextFile>,
    /// Terrain file of the motion.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    terrain: Option<TextFile>,
}

/// Format of problem files.
const JSON: Format = Format {
    name: PROBLEM_FORMAT,
    version: VERSION,
    what: "problem",
    make_again: "write it again with --dump",
    help: "write a problem file with `rollwalk plan --dump`; docs/problem-files.md lists every \
        field",
};

/// Problem after parsing and validation.
pub struct ParsedProblem {
    pub robot: Robot,
    pub motion: Motion,
    /// Plan used as the starting point.
    pub from: Option<Plan>,
}

impl Problem {
    /// Creates a problem from the given texts.
    pub fn new(texts: MotionTexts, from: Option<TextFile>, options: Choices) -> Self {
        let MotionTexts { motion, robot, terrain } = texts;
        let (format, program) = (PROBLEM_FORMAT.to_owned(), PROGRAM.to_owned());
        Self { format, version: VERSION, program, options, motion, robot, terrain, from }
    }

    /// Parses a problem file; errors name it `file`.
    ///
    /// # Errors
    /// Returns a [`JsonError`] with the file, the field, its value and the valid values.
    pub fn from_json(file: &str, text: &str) -> Result<Self, JsonError> {
        JSON.read(file, text)
    }

    /// Program that wrote the file; `None` if it is this version. The plans of another version may differ.
    pub fn other_program(&self) -> Option<&str> {
        (self.program != PROGRAM).then_some(&*self.program)
    }

    /// Converts the problem to readable JSON, marked as written by this program.
    pub fn to_json(&self) -> String {
        let own = Self { program: PROGRAM.to_owned(), ..self.clone() };
        // Only maps with non-string keys can fail to become JSON; a problem has no map.
        serde_json::to_string_pretty(&own).unwrap_or_default() + "\n"
    }

    /// Parses and validates the texts. `origin` is the problem file that contains them, if they are not separate files.
    ///
    /// # Errors
    /// Returns all mistakes in the first text that has any.
    pub fn parse(&self, origin: Option<&Path>) -> miette::Result<ParsedProblem> {
        let named = |file: &TextFile| match origin {
            Some(origin) => {
                let path = format!("{}: {}", origin.display(), file.path);
                TextFile { path, text: file.text.clone() }
            }
            None => file.clone(),
        };
        let parts = [(Some(&self.motion), Kind::Motion), (Some(&self.robot), Kind::Robot)];
        let optional = [(self.terrain.as_ref(), Kind::Terrain), (self.from.as_ref(), Kind::Plan)];
        for (file, kind) in parts.into_iter().chain(optional) {
            // Each text has the size limit of a separate file.
            let Some(file) = file.filter(|file| file.text.len() as u64 > kind.max_bytes()) else {
                continue;
            };
            let (path, bytes) = (named(file).path.into(), Some(file.text.len() as u64));
            return Err(FileError::TooLarge { kind, path, bytes }.into());
        }
        let texts = MotionTexts {
            motion: named(&self.motion),
            robot: named(&self.robot),
            terrain: self.terrain.as_ref().map(named),
        };
        let (robot, motion) = texts.parse()?;
        let plan = |file: &TextFile| {
            let TextFile { path, text } = named(file);
            let explain = Kind::Plan.explain(Path::new(&path), &text);
            Plan::from_json(&path, &text).map_err(explain)
        };
        let from = self.from.as_ref().map(plan).transpose()?;
        Ok(ParsedProblem { robot, motion, from })
    }
}
