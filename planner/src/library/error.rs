//! Why plans do not make a library.

use rollwalk_protocol::library::{EncodeError, Reject};
use rollwalk_robot::InvalidRobot;
use thiserror::Error;

/// Plans that no library can be made of.
#[derive(Clone, Debug, PartialEq, Error)]
pub enum LibraryError {
    /// The robot is not valid.
    #[error(transparent)]
    Robot(#[from] InvalidRobot),
    /// A plan is for another robot, or for another version of it.
    #[error(
        "{motion} is planned for another robot, `{found}`; expected `{expected}` exactly as its file \
         is now: plan the motion again"
    )]
    OtherRobot {
        /// The motion.
        motion: String,
        /// Robot of the plan.
        found: String,
        /// Robot of the library.
        expected: String,
    },
    /// A time that no frame falls on.
    #[error("{motion}: {field} is {time_s} s; expected a multiple of 1/60 s")]
    NotOnFrame {
        /// The motion or transition.
        motion: String,
        /// Which of its times.
        field: &'static str,
        /// The time, s.
        time_s: f64,
    },
    /// A transition joins a motion that is not there.
    #[error("{transition} joins motion number {motion}, which does not exist")]
    NoSuchMotion {
        /// The transition.
        transition: String,
        /// Number of the motion.
        motion: usize,
    },
    /// A value beyond the limits of its channel.
    #[error(
        "{motion}: {channel} is at {value:.3} {unit} after {time_s:.3} s; limits are {min:.3} to {max:.3}"
    )]
    OutOfLimits {
        /// The motion or transition.
        motion: String,
        /// Joint or end effector.
        channel: String,
        /// When, s since the start.
        time_s: f64,
        /// The value.
        value: f64,
        /// Smallest value.
        min: f64,
        /// Largest value.
        max: f64,
        /// Unit of the values.
        unit: &'static str,
    },
    /// A value that changes faster than its motor can.
    #[error(
        "{motion}: {channel} changes by {rate:.2} {unit} per second before {time_s:.3} s; its limit is \
         {limit:.2}: give the motion more time"
    )]
    TooFast {
        /// The motion or transition.
        motion: String,
        /// Joint or end effector.
        channel: String,
        /// When the change has happened, s since the start.
        time_s: f64,
        /// Rate of change, unit per second.
        rate: f64,
        /// Fastest change, unit per second.
        limit: f64,
        /// Unit of the value.
        unit: &'static str,
    },
    /// The encoder refuses the library.
    #[error("{error} (clips in order: {})", .clips.join(", "))]
    Encode {
        /// Names of motions, then of transitions.
        clips: Vec<String>,
        /// Why.
        error: EncodeError,
    },
    /// The finished library is not what a controller accepts.
    #[error("the finished library is not valid: {0}")]
    Rejected(#[from] Reject),
    /// The finished library cannot be read back.
    #[error("the finished library cannot be read back")]
    Unreadable,
}
