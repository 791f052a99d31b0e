//! Errors of building a library from plans.

use rollwalk_protocol::library::{EncodeError, MAX_TILT_RAD, Reject};
use rollwalk_robot::InvalidRobot;
use thiserror::Error;

/// Fault of a plan, or of the library built from it.
#[derive(Clone, Debug, PartialEq, Error)]
pub enum LibraryError {
    /// The robot is not valid.
    #[error(transparent)]
    Robot(#[from] InvalidRobot),
    /// A plan was made for another robot, or for another version of its file.
    #[error(
        "{motion} is planned for robot `{found}`; expected `{expected}` exactly as its file is \
         now: plan the motion again"
    )]
    OtherRobot {
        /// Name of the motion.
        motion: String,
        /// Robot of the plan.
        found: String,
        /// Robot of the library.
        expected: String,
    },
    /// A time is not a multiple of 1/60 s.
    #[error("{motion}: {field} is {time_s} s; expected a multiple of 1/60 s")]
    NotOnFrame {
        /// Name of the motion or transition.
        motion: String,
        /// Name of the field that contains the time.
        field: &'static str,
        /// Time, s.
        time_s: f64,
    },
    /// A transition joins a motion that does not exist.
    #[error("{transition} joins motion number {motion}, but this motion does not exist")]
    NoSuchMotion {
        /// Name of the transition.
        transition: String,
        /// Index of the motion.
        motion: usize,
    },
    /// A value is beyond the limits of its channel.
    #[error(
        "{motion}: {channel} is at {value:.3} {unit} after {time_s:.3} s; expected {min:.3} to \
         {max:.3} {unit}"
    )]
    OutOfLimits {
        /// Name of the motion or transition.
        motion: String,
        /// Name of the joint or end effector.
        channel: String,
        /// Time since the start, s.
        time_s: f64,
        /// Value that exceeds the limits.
        value: f64,
        /// Smallest value.
        min: f64,
        /// Largest value.
        max: f64,
        /// Unit of the values.
        unit: &'static str,
    },
    /// A value changes faster than its motor allows.
    #[error(
        "{motion}: {channel} changes by {rate:.2} {unit} per second just before {time_s:.3} s; \
         give the motion a longer duration, because the limit is {limit:.2} {unit} per \
         second{cause}"
    )]
    TooFast {
        /// Name of the motion or transition.
        motion: String,
        /// Name of the joint or end effector.
        channel: String,
        /// Time since the start of the motion, at the end of the change, s.
        time_s: f64,
        /// Rate of change, unit per second.
        rate: f64,
        /// Limit of the rate of change, unit per second.
        limit: f64,
        /// Origin of the limit, to follow its unit.
        cause: &'static str,
        /// Unit of the value.
        unit: &'static str,
    },
    /// A motion tilts its body further than the controller's tilt protection allows.
    #[error(
        "{motion}: the body tilts by {tilt_rad:.3} rad; reduce the tilt to {MAX_TILT_RAD:.3} rad \
         (60°), because the controller cannot distinguish a larger tilt from a fall"
    )]
    Tilted {
        /// Name of the motion or transition.
        motion: String,
        /// Sum of the mean tilt and the largest deviation from it, rad.
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
