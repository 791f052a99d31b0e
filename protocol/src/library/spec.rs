//! Contents of a library, and the errors that they can have.

use super::reject::Reject;
use super::{MAX_CLIP_FRAMES, MAX_NAME};
use crate::config::{ConfigError, RobotConfig};
use core::fmt;
use thiserror::Error;

/// Largest distance of a joint in a transition's first or last frame from the motion that it joins, rad. The encoder moves the
/// joint onto the motion's frame, so the library has no gap.
pub const JOIN_TOLERANCE_RAD: f32 = 0.005;

/// Frames over which the encoder leads a transition's torques over to those of the motions that it joins: 0.1 s.
pub const TORQUE_BLEND_FRAMES: usize = 6;

/// Contents of a library.
#[derive(Clone, Copy, Debug)]
pub struct LibrarySpec<'a> {
    /// The robot that it is for.
    pub config: &'a RobotConfig,
    /// The motions: nodes of the graph, 1 to [`MAX_MOTIONS`](super::MAX_MOTIONS).
    pub motions: &'a [MotionSpec<'a>],
    /// The transitions: edges of the graph, up to [`MAX_TRANSITIONS`](super::MAX_TRANSITIONS).
    pub transitions: &'a [TransitionSpec<'a>],
    /// Number of the motion that is SAFE. It must come to rest: not loop, or hold still.
    pub safe: usize,
}

/// A motion to put into a library.
#[derive(Clone, Copy, Debug)]
pub struct MotionSpec<'a> {
    /// Name, 1 to [`MAX_NAME`] bytes.
    pub name: &'a str,
    /// Command code that selects it.
    pub code: u8,
    /// n frames that repeat: frame n−1 is followed by frame 0, do not give frame 0 twice.
    /// Otherwise the motion stays at its last frame, where its wheels must (nearly) rest.
    pub looping: bool,
    /// Frames at 60 Hz one after the other, each with one value for every channel: joint angles in
    /// rad, then wheel motor speeds in rad/s.
    pub frames: &'a [f32],
    /// Torques of the actuators at these frames in the same order, N·m, within the channels' limits; empty for none.
    /// All clips have them or none.
    pub torques: &'a [f32],
}

/// A transition to put into a library.
#[derive(Clone, Copy, Debug)]
pub struct TransitionSpec<'a> {
    /// Number of the motion that it leaves.
    pub from: usize,
    /// Frame of that motion that is the transition's first frame.
    pub exit_frame: u16,
    /// Number of the motion that it leads to.
    pub to: usize,
    /// Frame of that motion that is the transition's last frame.
    pub entry_frame: u16,
    /// Frames at 60 Hz, like those of a motion; two at least.
    pub frames: &'a [f32],
    /// Torques, like those of a motion. At each end they may be off those of the motion that it joins by the channel's
    /// limit: the encoder leads over to them within [`TORQUE_BLEND_FRAMES`].
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

/// A clip of a [`LibrarySpec`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ClipRef {
    /// Number of a motion.
    Motion(usize),
    /// Number of a transition.
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

/// A specification that no library can be made of.
#[derive(Clone, Copy, Debug, PartialEq, Error)]
#[non_exhaustive]
pub enum EncodeError {
    /// The robot's configuration is unusable.
    #[error("the robot's configuration is unusable: {0}")]
    Config(#[from] ConfigError),
    /// Too few or too many of something.
    #[error("{what}: {found}, must be {min} to {max}")]
    Count {
        /// Item counted.
        what: &'static str,
        /// Number of items.
        found: usize,
        /// Fewest.
        min: usize,
        /// Most.
        max: usize,
    },
    /// The number of values is no multiple of the number of channels, or there are none or too
    /// many.
    #[error(
        "{clip}: {values} values are not {min} to {MAX_CLIP_FRAMES} frames of {channels} channels"
    )]
    Shape {
        /// The clip.
        clip: ClipRef,
        /// Values given.
        values: usize,
        /// Channels of the robot.
        channels: usize,
        /// Fewest frames of such a clip.
        min: usize,
    },
    /// A name that is empty or too long.
    #[error("motion {motion}: its name has {len} bytes, must have 1 to {MAX_NAME}")]
    Name {
        /// Number of the motion.
        motion: usize,
        /// Bytes of the name.
        len: usize,
    },
    /// A name with characters that a terminal obeys or hides, or with a space at an end.
    #[error("motion {motion}: its name has characters that cannot be seen, or a space at an end")]
    UnclearName {
        /// Number of the motion.
        motion: usize,
    },
    /// Two motions with one name.
    #[error("motions {first} and {second} have the same name")]
    DuplicateName {
        /// Number of one.
        first: usize,
        /// Number of the other.
        second: usize,
    },
    /// A value that is NaN or outside the channel's limits.
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
    /// Clip whose number of torques differs from its number of values, where other clips have torques.
    #[error("{clip}: {torques} torques are not one for each of its {values} values")]
    TorqueShape {
        /// The clip.
        clip: ClipRef,
        /// Torques given.
        torques: usize,
        /// Values given.
        values: usize,
    },
    /// A torque that is NaN or beyond the channel's limit.
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
    /// A transition's torque at an end is too far from that of the motion that it joins.
    #[error(
        "{clip}, frame {frame}, channel {channel}: a torque of {torque_nm} N·m must be within {tolerance_nm} N·m of \
         {expected_nm} N·m, where it ends"
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
    /// A transition names a motion or a frame that does not exist.
    #[error(
        "transition {transition}: joins motion {motion} at frame {frame}, which does not exist"
    )]
    NoSuchFrame {
        /// Number of the transition.
        transition: usize,
        /// Number of the motion.
        motion: usize,
        /// The frame.
        frame: u16,
    },
    /// An end too far from its required value: a transition's end from the frame that it joins, or a wheel's speed at the end of
    /// a motion from 0.
    #[error(
        "{clip}, frame {frame}, channel {channel}: {value} must be within {tolerance} of \
         {expected}, where it ends (rad, or rad/s for a wheel)"
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
        /// Number of a motion.
        first: usize,
        /// Number of another.
        second: usize,
        /// Common command code.
        code: u8,
    },
    /// The attitude of a clip is missing, or is not a unit vector with an angle, or beyond [`MAX_TILT_RAD`](super::MAX_TILT_RAD).
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
        /// Bytes of the buffer.
        room: usize,
    },
    /// The library would be refused by the robot.
    #[error("the robot would refuse this library: {0}")]
    Rejected(#[from] Reject),
}
