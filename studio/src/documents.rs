//! Documents of a project: resolves paths to texts, and parses texts to a validated robot and motion.
//!
//! A page opens files by paths that may differ from the paths in documents: a motion file that was dropped alone contains
//! `../robots/agilebot.toml`. A path therefore stands for the first of: the open file at that path, the only open file with
//! that base name, and the shipped file with that base name.

use crate::messages::{Answer, Fault, File};
use rollwalk_planner::motion::Motion;
use rollwalk_robot::document::DocumentError;
use rollwalk_robot::{Robot, Solid};

/// Documents of a request.
#[derive(Clone, Copy)]
pub struct Documents<'f> {
    files: &'f [File],
}

/// Text found for a path.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct DocumentText<'f> {
    pub path: &'f str,
    pub text: &'f str,
}

/// Motion file with the robot file that it names, both validated.
pub struct Project<'f> {
    pub robot: Robot,
    /// Solids of every link.
    pub parts: Vec<Vec<Solid>>,
    pub motion: Motion,
    pub motion_file: DocumentText<'f>,
    pub robot_file: DocumentText<'f>,
}

impl<'f> Documents<'f> {
    /// Wraps the documents of a request.
    pub fn new(files: &'f [File]) -> Self {
        Self { files }
    }

    /// Documents contained in the request.
    pub fn files(&self) -> &'f [File] {
        self.files
    }

    /// Reads and validates a motion file and the robot file that it names.
    ///
    /// # Errors
    /// Returns all faults of the first document that has any, or an error if a document is missing.
    pub fn project(&self, motion: &str) -> Result<Project<'f>, Answer> {
        let motion_file = self.find(motion).ok_or_else(|| missing("motion file", motion, ""))?;
        let robot_file = self.robot_of(motion_file)?;
        let DocumentText { path, text } = robot_file;
        let (robot, parts) =
            Robot::with_parts_from_toml(path, text).map_err(|error| faults(text, &error))?;
        let DocumentText { path, text } = motion_file;
        let motion = Motion::from_toml(path, text, &robot).map_err(|error| faults(text, &error))?;
        Ok(Project { robot, parts, motion, motion_file, robot_file })
    }

    /// Reads and validates a robot file.
    ///
    /// # Errors
    /// Returns the faults of the file.
    pub fn robot(&self, DocumentText { path, text }: DocumentText<'f>) -> Result<Robot, Answer> {
        Robot::from_toml(path, text).map_err(|error| faults(text, &error))
    }

    /// Reads and validates a motion file and the robot file that it names, without the solids.
    ///
    /// # Errors
    /// Returns the errors of [`project`](Self::project).
    pub fn motion(&self, found: DocumentText<'f>) -> Result<(Robot, Motion), Answer> {
        let robot = self.robot(self.robot_of(found)?)?;
        let DocumentText { path, text } = found;
        let motion = Motion::from_toml(path, text, &robot).map_err(|error| faults(text, &error))?;
        Ok((robot, motion))
    }

    /// Robot file that a motion file names.
    fn robot_of(
        &self,
        DocumentText { path, text }: DocumentText<'f>,
    ) -> Result<DocumentText<'f>, Answer> {
        let named = Motion::robot_path_in_toml(path, text).map_err(|error| faults(text, &error))?;
        self.beside(path, &named).ok_or_else(|| missing("robot file", &named, path))
    }

    /// Text of the file that the document at `from` names `named`.
    pub fn beside(&self, from: &str, named: &str) -> Option<DocumentText<'f>> {
        let folder = from.rsplit_once('/').map_or("", |(folder, _)| folder);
        self.find(&joined(folder, named))
    }

    /// Text of the file for a path.
    pub fn find(&self, path: &str) -> Option<DocumentText<'f>> {
        let path = joined("", path);
        let of = |file: &'f File| DocumentText { path: &file.path, text: &file.text };
        if let Some(file) = self.files.iter().find(|file| joined("", &file.path) == path) {
            return Some(of(file));
        }
        let name = base_name(&path);
        let mut same = self.files.iter().filter(|file| base_name(&file.path) == name);
        if let (Some(file), None) = (same.next(), same.next()) {
            return Some(of(file));
        }
        let shipped =
            rollwalk_shipped::FILES.iter().map(|&(path, text)| DocumentText { path, text });
        if let Some(found) = shipped.clone().find(|found| found.path == path) {
            return Some(found);
        }
        let mut same = shipped.filter(|found| base_name(found.path) == name);
        same.next().filter(|_| same.next().is_none())
    }
}

/// Joins a folder and a path, without `.` and without detours through `..`.
fn joined(folder: &str, path: &str) -> String {
    let mut parts: Vec<&str> = Vec::new();
    let folder = if path.starts_with('/') { "" } else { folder };
    for part in folder.split('/').chain(path.split('/')) {
        match part {
            "" | "." => {}
            ".." if parts.last().is_some_and(|last| *last != "..") => {
                parts.pop();
            }
            part => parts.push(part),
        }
    }
    parts.join("/")
}

fn base_name(path: &str) -> &str {
    path.rsplit_once('/').map_or(path, |(_, name)| name)
}

/// Error of a missing document.
pub fn missing(kind: &str, named: &str, by: &str) -> Answer {
    let by = if by.is_empty() { String::new() } else { format!(" (named in {by})") };
    Answer::Error {
        message: format!("the {kind} `{named}`{by} is not open"),
        help: "open this file too, or name a robot that ships with rollwalk, such as \
               `../robots/agilebot.toml`"
            .to_owned(),
    }
}

/// Converts the faults of a document to an answer.
pub fn faults(text: &str, error: &DocumentError) -> Answer {
    let fault = |fault: &rollwalk_robot::document::Fault| {
        let start = text.floor_char_boundary(fault.span.start);
        let line = text[..start].rfind('\n').map_or(0, |newline| newline + 1);
        Fault {
            path: error.file_name().to_owned(),
            message: fault.message.clone(),
            label: fault.label.clone(),
            help: fault.help.clone(),
            line: fault.line,
            column: 1 + text[line..start].chars().count(),
            span: [fault.span.start, fault.span.end],
        }
    };
    Answer::Faults { faults: error.faults().map(fault).collect() }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn file(path: &str, text: &str) -> File {
        File { path: path.into(), text: text.into() }
    }

    #[test]
    fn names_mean_the_nearest_file() {
        let files = [file("a/robots/r.toml", "1"), file("b/q.toml", "2"), file("c/q.toml", "3")];
        let documents = Documents::new(&files);
        let text = |from: &str, named: &str| documents.beside(from, named).map(|found| found.text);
        assert_eq!(text("a/motions/walk.toml", "../robots/r.toml"), Some("1"));
        assert_eq!(text("walk.toml", "../robots/r.toml"), Some("1"), "its only namesake");
        assert_eq!(text("c/walk.toml", "./q.toml"), Some("3"));
        assert_eq!(text("walk.toml", "q.toml"), None, "two namesakes");
        let shipped = rollwalk_shipped::text("robots/agilebot.toml");
        assert_eq!(text("walk.toml", "../robots/agilebot.toml"), shipped);
        // Two shipped motions have this name.
        assert_eq!(text("walk.toml", "x/swizzlebot_forward.toml"), None);
        let shipped = rollwalk_shipped::text("motions/swizzlebot_forward.toml");
        assert_eq!(text("", "motions/swizzlebot_forward.toml"), shipped);
    }
}
