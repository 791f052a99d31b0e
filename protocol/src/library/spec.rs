//! Specification of a library, and its possible errors.

use super::reject::Reject;
use super::{MAX_CLIP_FRAMES, MAX_NAME};
use crate::config::{ConfigError, RobotConfig};
use core::fmt;
use thiserror::Error;

/// Largest distance of a joint in a transition's first or last frame from the joined motion, rad. The encoder moves the joint
/// onto the motion's frame, so that the library has no gap.
pub const JOIN_TOLERANCE_RAD: f32 = 0.005;

/// Number of frames over which the encoder blends a transition's torques into those of the joined motions: 0.1 s.
pub const TORQUE_BLEND_FRAMES: usize = 6;

/// Specification of a library.
#[derive(Clone, Copy, Debug)]
pub struct LibrarySpec<'a> {
    /// Configuration of the robot.
    pub config: &'a RobotConfig,
    /// Motions, the nodes of the graph: 1 to [`MAX_MOTIONS`](super::MAX_MOTIONS).
    pub motions: &'a [MotionSpec<'a>],
    /// Transitions, the edges of the graph: up to [`MAX_TRANSITIONS`](super::MAX_TRANSITIONS).
    pub transitions: &'a [TransitionSpec<'a>],
    /// Index of the SAFE motion. It must come to rest: either it does not loop, or all its frames are equal.
    pub safe: usize,
}

/// Motion of a library.
#[derive(Clone, Copy, Debug)]
pub struct MotionSpec<'a> {
    /// Name, 1 to [`MAX_NAME`] bytes.
    pub name: &'a str,
    /// Command code that selects the motion.
    pub code: u8,
    /// True if frame 0 follows the last frame; do not append frame 0 again. Otherwise the motion stays at its last frame, where
    /// its wheels must be nearly at rest.
    pub looping: bool,
    /// Frames at 60 Hz one after the other. Each has one value for every channel: joint angles in rad, then wheel motor speeds
    /// in rad/s.
    pub frames: &'a [f32],
    /// Torques of the actuators in these frames, in the same order, N·m, within the channels' limits. Empty if there are none.
    /// Either all clips have torques, or none has.
    pub torques: &'a [f32],
}

/// Transition of a library.
#[derive(Clone, Copy, Debug)]
pub struct TransitionSpec<'a> {
    /// Index of the source motion.
    pub from: usize,
    /// Frame of the source motion that equals the transition's first frame.
    pub exit_frame: u16,
    /// Index of the target motion.
    pub to: usize,
    /// Frame of the target motion that equals the transition's last frame.
    pub entry_frame: u16,
    /// Frames at 60 Hz, in the layout of [`MotionSpec::frames`]; at least two.
    pub frames: &'a [f32],
    /// Torques, in the layout of [`MotionSpec::torques`]. At each end they may differ from those of the joined motion by the
    /// channel's limit. The encoder blends them within [`TORQUE_BLEND_FRAMES`].
    pub torques: &'a [f32],
}

impl<'a> TransitionSpec<'a> {
    /// Transition from frame `exit_frame` of motion `from` to frame `entry_frame` of motion `to`, without torques.
    pub const fn new(
        from: usize,
        exit_frame: u16,
        to: usize,
        entry_frame: u16,
        frames: &'a [f32],
    ) -> Self {
        Self { from, exit_frame, to, entry_frame, frames, torques: &[] }
    }
}

/// Clip of a [`LibrarySpec`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ClipRef {
    /// Motion, by its index.
    Motion(usize),
    /// Transition, by its index.
    Transition(usize),
}

impl fmt::Display for ClipRef {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            ClipRef::Motion(i) => write!(f, "motion {i}"),
            ClipRef::Transition(i) => write!(f, "transition {i}"),
        }
    }
}

/// Reason why a specification cannot be encoded.
#[derive(Clone, Copy, Debug, PartialEq, Error)]
#[non_exhaustive]
pub enum EncodeError {
    /// The robot's configuration is unusable.
    #[error("the robot's configuration is unusable: {0}")]
    Config(#[from] ConfigError),
    /// A count is outside its range.
    #[error("{what}: {found}; expected {min} to {max}")]
    Count {
        /// Counted item.
        what: &'static str,
        /// Actual count.
        found: usize,
        /// Minimum count.
        min: usize,
        /// Maximum count.
        max: usize,
    },
    /// The number of values is not a multiple of the number of channels, or the number of frames is outside its range.
    #[error(
        "{clip}: {values} values; expected {min} to {MAX_CLIP_FRAMES} frames of {channels} \
         channels"
    )]
    Shape {
        /// The clip.
        clip: ClipRef,
        /// Number of values.
        values: usize,
        /// Number of channels of the robot.
        channels: usize,
        /// Minimum number of frames of the clip: 2 for a transition, otherwise 1.
        min: usize,
    },
    /// A name is empty or too long.
    #[error("motion {motion}: its name has {len} bytes; expected 1 to {MAX_NAME}")]
    Name {
        /// Index of the motion.
        motion: usize,
        /// Length of the name, bytes.
        len: usize,
    },
    /// A name has a space at an end, or characters that terminals hide or interpret.
    #[error("motion {motion}: its name has invisible characters, or a space at the start or end")]
    UnclearName {
        /// Index of the motion.
        motion: usize,
    },
    /// Two motions have the same name.
    #[error("motions {first} and {second} have the same name")]
    DuplicateName {
        /// Index of the first motion.
        first: usize,
        /// Index of the second motion.
        second: usize,
    },
    /// A value is NaN or outside the limits of its channel.
    #[error(
        "{clip}, frame {frame}, channel {channel}: {value} is outside the limits {min} to {max} \
         (rad, or rad/s for a wheel)"
    )]
    OutOfLimits {
        /// The clip.
        clip: ClipRef,
        /// The frame.
        frame: usize,
        /// The channel.
        channel: usize,
        /// The value.
        value: f32,
        /// Smallest value.
        min: f32,
        /// Largest value.
        max: f32,
    },
    /// The number of torques of a clip differs from its number of values, although some clip has torques.
    #[error("{clip}: {torques} torques; expected one for each of its {values} values")]
    TorqueShape {
        /// The clip.
        clip: ClipRef,
        /// Number of torques.
        torques: usize,
        /// Number of values.
        values: usize,
    },
    /// A torque is NaN or beyond the limit of its channel.
    #[error(
        "{clip}, frame {frame}, channel {channel}: a torque of {torque_nm} N·m is beyond the limit of {limit_nm} N·m"
    )]
    TorqueBeyondLimit {
        /// The clip.
        clip: ClipRef,
        /// The frame.
        frame: usize,
        /// The channel.
        channel: usize,
        /// The torque, N·m.
        torque_nm: f32,
        /// Largest torque, N·m.
        limit_nm: f32,
    },
    /// A torque at an end of a transition is too far from that of the joined motion.
    #[error(
        "{clip}, frame {frame}, channel {channel}: the torque at this end is {torque_nm} N·m; \
         expected a torque within {tolerance_nm} N·m of {expected_nm} N·m"
    )]
    TorqueMismatch {
        /// The clip.
        clip: ClipRef,
        /// The frame.
        frame: usize,
        /// The channel.
        channel: usize,
        /// The torque, N·m.
        torque_nm: f32,
        /// Required torque, N·m.
        expected_nm: f32,
        /// Allowed difference, N·m: the channel's limit.
        tolerance_nm: f32,
    },
    /// A transition refers to a motion or a frame that does not exist.
    #[error(
        "transition {transition}: joins motion {motion} at frame {frame}, which does not exist"
    )]
    NoSuchFrame {
        /// Index of the transition.
        transition: usize,
        /// Index of the motion.
        motion: usize,
        /// The frame.
        frame: u16,
    },
    /// The end of a clip is too far from its required value. For a transition this is the joined frame; for a wheel at the end
    /// of a motion, 0 rad/s.
    #[error(
        "{clip}, frame {frame}, channel {channel}: the value at this end is {value}; expected a \
         value within {tolerance} of {expected} (rad, or rad/s for a wheel)"
    )]
    EndMismatch {
        /// The clip.
        clip: ClipRef,
        /// The frame.
        frame: usize,
        /// The channel.
        channel: usize,
        /// The value.
        value: f32,
        /// Required value.
        expected: f32,
        /// Allowed difference.
        tolerance: f32,
    },
    /// Two motions have the same code.
    #[error("motions {first} and {second} have the same command code {code}")]
    DuplicateCode {
        /// Index of the first motion.
        first: usize,
        /// Index of the second motion.
        second: usize,
        /// Common command code.
        code: u8,
    },
    /// The attitude of a clip is missing, is not a unit vector with an angle, or is beyond
    /// [`MAX_TILT_RAD`](super::MAX_TILT_RAD).
    #[error(
        "{clip}: its attitude must be a unit vector and an angle, together at most 60° from upright"
    )]
    Attitude {
        /// The clip.
        clip: ClipRef,
    },
    /// The buffer is too small.
    #[error("the library does not fit into {room} bytes")]
    Full {
        /// Size of the buffer, bytes.
        room: usize,
    },
    /// The encoded library fails validation, so that the robot would refuse it.
    #[error("the robot would refuse this library: {0}")]
    Rejected(#[from] Reject),
}
