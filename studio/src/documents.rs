//! Documents of a project: which text a path means, and texts to a validated robot and motion.
//!
//! A page knows files by the paths with which they were opened, which need not be those that documents name each other by: a
//! motion file that was dropped alone says `../robots/agilebot.toml`. So a name means, in this order, the file at that path,
//! the only file of that base name, and the same among the files that ship.

use crate::messages::{Answer, Fault, File};
use rollwalk_planner::motion::Motion;
use rollwalk_robot::document::DocumentError;
use rollwalk_robot::{Robot, Solid};

/// The documents of a request.
#[derive(Clone, Copy)]
pub struct Documents<'f> {
    files: &'f [File],
}

/// A text that a path means.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Found<'f> {
    pub path: &'f str,
    pub text: &'f str,
}

/// A motion file and the robot file that it names, validated.
pub struct Project<'f> {
    pub robot: Robot,
    /// Parts of every link.
    pub parts: Vec<Vec<Solid>>,
    pub motion: Motion,
    pub motion_file: Found<'f>,
    pub robot_file: Found<'f>,
}

impl<'f> Documents<'f> {
    /// Documents of a request.
    pub fn new(files: &'f [File]) -> Self {
        Self { files }
    }

    /// The documents of the request itself.
    pub fn files(&self) -> &'f [File] {
        self.files
    }

    /// Reads and validates a motion file and the robot that it names.
    ///
    /// # Errors
    /// All faults of one of them, or a document that is missing.
    pub fn project(&self, motion: &str) -> Result<Project<'f>, Answer> {
        let motion_file = self.find(motion).ok_or_else(|| missing("motion file", motion, ""))?;
        let robot_file = self.robot_of(motion_file)?;
        let Found { path, text } = robot_file;
        let (robot, parts) =
            Robot::with_parts_from_toml(path, text).map_err(|error| faults(text, &error))?;
        let Found { path, text } = motion_file;
        let motion = Motion::from_toml(path, text, &robot).map_err(|error| faults(text, &error))?;
        Ok(Project { robot, parts, motion, motion_file, robot_file })
    }

    /// Reads and validates a robot file.
    ///
    /// # Errors
    /// Its faults.
    pub fn robot(&self, Found { path, text }: Found<'f>) -> Result<Robot, Answer> {
        Robot::from_toml(path, text).map_err(|error| faults(text, &error))
    }

    /// Reads and validates a motion file and the robot that it names.
    ///
    /// # Errors
    /// As [`project`](Self::project).
    pub fn motion(&self, found: Found<'f>) -> Result<(Robot, Motion), Answer> {
        let robot = self.robot(self.robot_of(found)?)?;
        let Found { path, text } = found;
        let motion = Motion::from_toml(path, text, &robot).map_err(|error| faults(text, &error))?;
        Ok((robot, motion))
    }

    /// The robot file that a motion file names.
    fn robot_of(&self, Found { path, text }: Found<'f>) -> Result<Found<'f>, Answer> {
        let named = Motion::robot_path_in_toml(path, text).map_err(|error| faults(text, &error))?;
        self.beside(path, &named).ok_or_else(|| missing("robot file", &named, path))
    }

    /// The text that `named` means in the document at `from`.
    pub fn beside(&self, from: &str, named: &str) -> Option<Found<'f>> {
        let folder = from.rsplit_once('/').map_or("", |(folder, _)| folder);
        self.find(&joined(folder, named))
    }

    /// The text that a path means.
    pub fn find(&self, path: &str) -> Option<Found<'f>> {
        let path = joined("", path);
        let of = |file: &'f File| Found { path: &file.path, text: &file.text };
        if let Some(file) = self.files.iter().find(|file| joined("", &file.path) == path) {
            return Some(of(file));
        }
        let name = base_name(&path);
        let mut same = self.files.iter().filter(|file| base_name(&file.path) == name);
        if let (Some(file), None) = (same.next(), same.next()) {
            return Some(of(file));
        }
        let shipped = rollwalk_shipped::FILES.iter().map(|&(path, text)| Found { path, text });
        if let Some(found) = shipped.clone().find(|found| found.path == path) {
            return Some(found);
        }
        let mut same = shipped.filter(|found| base_name(found.path) == name);
        same.next().filter(|_| same.next().is_none())
    }
}

/// A path in a folder, without `.` and without detours through `..`.
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

/// The error of a document that is not there.
pub fn missing(kind: &str, named: &str, by: &str) -> Answer {
    let by = if by.is_empty() { String::new() } else { format!(", which {by} names") };
    Answer::Error {
        message: format!("the {kind} `{named}`{by} is not open"),
        help: "open it too, or name a robot that ships with rollwalk, such as \
               `../robots/agilebot.toml`"
            .to_owned(),
    }
}

/// The faults of a document.
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
        // Two motions that ship have this name.
        assert_eq!(text("walk.toml", "x/swizzlebot_forward.toml"), None);
        let shipped = rollwalk_shipped::text("motions/swizzlebot_forward.toml");
        assert_eq!(text("", "motions/swizzlebot_forward.toml"), shipped);
    }
}
