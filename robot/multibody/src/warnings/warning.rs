//! Checked robot, and a warning about it.

use crate::{Standing, Tree};
use nalgebra::Vector3;
use std::fmt;

/// Warning about one or several parts of the robot.
pub(super) struct RobotWarning {
    /// Kind of a single part: `link`, `joint`, `motor` or `end effector`.
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
    /// Diagonal of the box around contacts, joints and link centres of mass, m. The frame of the body is arbitrary.
    pub size_m: f64,
}

impl<'a> CheckedRobot<'a> {
    pub fn new(tree: &'a Tree, standing: &'a Standing) -> Self {
        let frames = &standing.frames;
        let coms = (0..tree.robot().links.len()).map(|link| frames.link_com(tree, link));
        let contacts = standing.contacts.iter().map(|contact| contact.position);
        let joints = frames.link_origins.iter().skip(1).copied();
        Self { tree, standing, size_m: extent_m(joints.chain(coms).chain(contacts)) }
    }
}

/// Diagonal of the box around points, m; 0 without points.
pub(super) fn extent_m(points: impl IntoIterator<Item = Vector3<f64>>) -> f64 {
    let box_of = |[low, high]: [Vector3<f64>; 2], at: Vector3<f64>| [low.inf(&at), high.sup(&at)];
    let points = points.into_iter().map(|at| [at, at]);
    let corners = points.reduce(|corners, [at, _]| box_of(corners, at));
    corners.map_or(0.0, |[low, high]| (high - low).norm())
}

/// List of quoted names.
fn quoted<'n>(names: impl IntoIterator<Item = &'n str>) -> String {
    let names: Vec<_> = names.into_iter().map(|name| format!("`{name}`")).collect();
    names.join(", ")
}
