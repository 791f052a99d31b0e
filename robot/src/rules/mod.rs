//! Rules of a valid robot, for robot files and for robots inside plan files.
//!
//! A violation names its place and its field in the spelling of robot files. [`crate::file`] converts both to spans.

mod buses;
mod check;
mod end_effectors;
mod joints;
mod linkages;
mod links;
mod upright;

use check::Check;
pub(crate) use check::{ITEMS_MAX, LENGTH_MAX_M, is_a_length, length_help, show, violations};
pub(crate) use joints::{MotorMaxima, SPEEDS_MAX_RAD_S};

use rollwalk_protocol::text::Excerpt;
use std::fmt;

/// Item of a robot that violates a rule.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Item {
    /// Whole robot.
    Robot,
    /// `links[i]`.
    Link(usize),
    /// `joints[i]`.
    Joint(usize),
    /// `end_effectors[i]`.
    EndEffector(usize),
    /// Bus with the given number.
    Bus(u8),
}

/// Violation of a rule by a robot.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Violation {
    /// Item that violates the rule.
    pub place: Item,
    /// Field in the spelling of robot files.
    pub field: &'static str,
    /// Message with the name of the item.
    pub message: String,
    /// Help with a right value.
    pub help: String,
}

/// Error for a robot that violates rules, without a file.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub struct InvalidRobot {
    /// Name of the robot.
    pub name: String,
    /// Violated rules; never empty.
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
