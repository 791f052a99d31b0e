//! Reasons for which plans do not make a library.

use rollwalk_protocol::library::{EncodeError, MAX_TILT_RAD, Reject};
use rollwalk_robot::InvalidRobot;
use thiserror::Error;

/// Fault of a plan, or of the library built from it.
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
    /// A time is not that of a frame.
    #[error("{motion}: {field} is {time_s} s; expected a multiple of 1/60 s")]
    NotOnFrame {
        /// The motion or transition.
        motion: String,
        /// Field with the time.
        field: &'static str,
        /// The time, s.
        time_s: f64,
    },
    /// A transition joins a motion that does not exist.
    #[error("{transition} joins motion number {motion}, which does not exist")]
    NoSuchMotion {
        /// The transition.
        transition: String,
        /// Number of the motion.
        motion: usize,
    },
    /// A value is beyond the limits of its channel.
    #[error(
        "{motion}: {channel} is at {value:.3} {unit} after {time_s:.3} s; limits are {min:.3} to {max:.3}"
    )]
    OutOfLimits {
        /// The motion or transition.
        motion: String,
        /// Joint or end effector.
        channel: String,
        /// Time since the start, s.
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
    /// A value changes faster than its motor can.
    #[error(
        "{motion}: {channel} changes by {rate:.2} {unit} per second before {time_s:.3} s; its limit is \
         {limit:.2}: give the motion more time"
    )]
    TooFast {
        /// The motion or transition.
        motion: String,
        /// Joint or end effector.
        channel: String,
        /// Time at the end of the change since the start, s.
        time_s: f64,
        /// Rate of change, unit per second.
        rate: f64,
        /// Largest rate of change, unit per second.
        limit: f64,
        /// Unit of the value.
        unit: &'static str,
    },
    /// A motion tilts its body further than a controller's tilt protection allows.
    #[error(
        "{motion}: its body tilts by {tilt_rad:.3} rad; a library takes up to {MAX_TILT_RAD:.3} rad (60°), because the \
         controller could not tell more from a fall"
    )]
    Tilted {
        /// The motion or transition.
        motion: String,
        /// Mean tilt and largest deviation from it, rad.
        tilt_rad: f32,
    },
    /// The encoder refuses the library.
    #[error("{error} (clips in order: {})", .clips.join(", "))]
    Encode {
        /// Names of motions, then of transitions.
        clips: Vec<String>,
        /// Fault that the encoder reports.
        error: EncodeError,
    },
    /// A controller would refuse the finished library.
    #[error("the finished library is not valid: {0}")]
    Rejected(#[from] Reject),
    /// The finished library cannot be read back.
    #[error("the finished library cannot be read back")]
    Unreadable,
}
