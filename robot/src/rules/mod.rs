//! Rules of a valid robot, whatever it was read from.
//!
//! Robot files (spans known) and robots inside plan files (no spans) pass the same rules. A
//! violation names its place and its field as robot files spell it; [`crate::file`] turns these
//! into spans.

mod buses;
mod check;
mod end_effectors;
mod joints;
mod links;
mod upright;

use check::Check;
pub(crate) use check::{ITEMS_MAX, LENGTH_MAX_M, is_a_length, length_help, show, violations};

use rollwalk_protocol::text::Excerpt;
use std::fmt;

/// The item of a robot that a violation is about.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Item {
    /// The robot as a whole.
    Robot,
    /// `links[i]`.
    Link(usize),
    /// `joints[i]`.
    Joint(usize),
    /// `end_effectors[i]`.
    EndEffector(usize),
    /// The bus of this number.
    Bus(u8),
}

/// A rule that a robot breaks.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Violation {
    /// The item.
    pub place: Item,
    /// The field, as robot files spell it.
    pub field: &'static str,
    /// The mistake, naming the item.
    pub message: String,
    /// Help: a right value.
    pub help: String,
}

/// A robot that breaks rules, without a file to point into.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub struct InvalidRobot {
    /// Name of the robot.
    pub name: String,
    /// The broken rules; never empty.
    pub violations: Vec<Violation>,
}

impl fmt::Display for InvalidRobot {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "robot `{}` is not valid", Excerpt::start_of(&self.name))?;
        for violation in &self.violations {
            write!(f, "\n  {} ({})", violation.message, violation.help)?;
        }
        Ok(())
    }
}
