//! Checked robot, and a warning about it.

use crate::{Standing, Tree};
use nalgebra::Vector3;
use std::fmt;

/// Warning about one or several parts of the robot.
pub(super) struct RobotWarning {
    /// Kind of a single part: `link`, `joint` or `end effector`.
    pub kind: &'static str,
    pub names: Vec<String>,
    pub text: String,
}

impl RobotWarning {
    pub fn of(kind: &'static str, name: &str, text: String) -> Self {
        Self { kind, names: vec![name.to_owned()], text }
    }
}

impl fmt::Display for RobotWarning {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let names = quoted(self.names.iter().map(String::as_str));
        let plural = if self.names.len() > 1 { "s" } else { "" };
        write!(f, "{}{plural} {names}: {}", self.kind, self.text)
    }
}

/// Standing robot with its size.
pub(super) struct CheckedRobot<'a> {
    pub tree: &'a Tree,
    pub standing: &'a Standing,
    /// Diagonal of the box around contacts, link origins and link centres of mass, m.
    pub size_m: f64,
}

impl<'a> CheckedRobot<'a> {
    pub fn new(tree: &'a Tree, standing: &'a Standing) -> Self {
        let frames = &standing.frames;
        let coms = (0..tree.robot().links.len()).map(|link| frames.link_com(tree, link));
        let contacts = standing.contacts.iter().map(|contact| contact.position);
        let points = frames.link_origins.iter().copied().chain(coms).chain(contacts);
        let none = [Vector3::repeat(f64::INFINITY), Vector3::repeat(f64::NEG_INFINITY)];
        let [low, high] = points.fold(none, |[low, high], at| [low.inf(&at), high.sup(&at)]);
        Self { tree, standing, size_m: (high - low).norm() }
    }
}

/// List of quoted names.
fn quoted<'n>(names: impl IntoIterator<Item = &'n str>) -> String {
    let names: Vec<_> = names.into_iter().map(|name| format!("`{name}`")).collect();
    names.join(", ")
}
