//! Reasons for refusing a library, whose texts read as sentences.

use super::{ClipId, EdgeId, FORMAT_MAJOR, MAX_CLIP_FRAMES, NodeId, RATE_HZ};
use crate::text::{Limit, Number};
use core::fmt;
use thiserror::Error;

/// Refusal of a library, with the position of the fault and the reason.
#[derive(Clone, Copy, Debug, PartialEq, Error)]
#[error("{section} at byte {offset}: {why}")]
pub struct Reject {
    /// Section of the file.
    pub section: Section,
    /// Offset of the fault from the start of the file, bytes.
    pub offset: u32,
    /// Reason for the refusal.
    pub why: RejectReason,
}

/// Section of a library file, including header, section table and footer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Section {
    /// Fixed header.
    Header,
    /// Table of the sections.
    Table,
    /// Counts, frame rate, and hash of the robot's configuration.
    Manifest,
    /// Channel table.
    Channels,
    /// Clip table.
    Clips,
    /// Frame blocks.
    Frames,
    /// Transitions of the motion graph.
    Edges,
    /// Precomputed routes.
    Routes,
    /// Command codes.
    Codes,
    /// Safe pose.
    SafePose,
    /// Names of the motions.
    Names,
    /// Quanta of the torques.
    TorqueQuanta,
    /// Positions of the torques of each clip.
    TorqueClips,
    /// Blocks of torques.
    Torques,
    /// Fixed footer.
    Footer,
}

impl Section {
    /// Index of the section, its tag − 1; `None` for header, section table and footer, which lack a tag.
    pub(crate) fn index(self) -> Option<usize> {
        match self {
            Section::Header | Section::Table | Section::Footer => None,
            Section::Manifest => Some(0),
            Section::Channels => Some(1),
            Section::Clips => Some(2),
            Section::Frames => Some(3),
            Section::Edges => Some(4),
            Section::Routes => Some(5),
            Section::Codes => Some(6),
            Section::SafePose => Some(7),
            Section::Names => Some(8),
            Section::TorqueQuanta => Some(9),
            Section::TorqueClips => Some(10),
            Section::Torques => Some(11),
        }
    }
}

impl Section {
    /// Code on the wire: the section's tag, 0 for header and section table, 255 for the footer.
    pub fn code(self) -> u8 {
        match self.index() {
            Some(index) => (index as u8).saturating_add(1),
            None if self == Section::Footer => 255,
            None => 0,
        }
    }
}

impl fmt::Display for Section {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Section::Header => "header",
            Section::Table => "section table",
            Section::Manifest => "manifest",
            Section::Channels => "channel table",
            Section::Clips => "clip table",
            Section::Frames => "frames",
            Section::Edges => "transition table",
            Section::Routes => "route table",
            Section::Codes => "command code table",
            Section::SafePose => "safe pose",
            Section::Names => "names",
            Section::TorqueQuanta => "torque quanta",
            Section::TorqueClips => "torque clip table",
            Section::Torques => "torques",
            Section::Footer => "footer",
        })
    }
}

/// Reason for refusing a library.
#[derive(Clone, Copy, Debug, PartialEq, Error)]
#[non_exhaustive]
pub enum RejectReason {
    /// The magic bytes are missing.
    #[error("this is not a motion library")]
    NotALibrary,
    /// The file has fewer bytes than the header states.
    #[error("truncated: {len} of {expected} bytes are present")]
    Truncated {
        /// Size of the file, bytes.
        len: u64,
        /// Size in the header, bytes.
        expected: u64,
    },
    /// The file has more bytes than the header states.
    #[error(
        "the file has {len} bytes, but the header states {expected}: remove the bytes after \
        the library"
    )]
    TrailingBytes {
        /// Size of the file, bytes.
        len: u64,
        /// Size in the header, bytes.
        expected: u64,
    },
    /// A checksum is wrong.
    #[error("corrupted: the CRC-32C is {computed:#010x}, but the file states {stored:#010x}")]
    Corrupted {
        /// Checksum in the file.
        stored: u32,
        /// Checksum of the bytes read.
        computed: u32,
    },
    /// The file has another major version of the format.
    #[error(
        "format version {found}, but this reader supports version {FORMAT_MAJOR}: build the \
         library and the firmware from the same release"
    )]
    OtherMajor {
        /// Major version of the file.
        found: u16,
    },
    /// A section extends beyond the end of the file.
    #[error("a section extends beyond the end of the file")]
    SectionBeyondEnd,
    /// A section is out of order, repeated, unknown to this minor version, or of a wrong size.
    #[error("section {tag} is out of order, repeated, unknown or has a wrong size")]
    BadSection {
        /// Tag of the section.
        tag: u16,
    },
    /// A required section is missing. If one section of torques is present, all of them are required.
    #[error("section {tag} is missing")]
    MissingSection {
        /// Tag of the section.
        tag: u16,
    },
    /// The reader's own robot configuration is unusable.
    #[error("the robot's configuration is unusable: {0}")]
    BadConfig(crate::config::ConfigError),
    /// The library was built for another robot, or for other limits of this robot.
    #[error(
        "built for another robot: the configuration hash is {library:#010x}, but this robot has \
         {robot:#010x}; build the library again from this robot's file"
    )]
    WrongRobot {
        /// Hash in the library.
        library: u32,
        /// Hash of the robot's configuration.
        robot: u32,
    },
    /// The frame rate is not 60 Hz.
    #[error("the frame rate is {found} Hz; expected {RATE_HZ} Hz")]
    WrongRate {
        /// Rate of the file.
        found: u16,
    },
    /// The number of records or bytes differs from the expected one, or records have a wrong size.
    #[error("{found} records, but the manifest requires {expected}")]
    WrongCount {
        /// Number in the file.
        found: u32,
        /// Number expected.
        expected: u32,
    },
    /// A count is outside its range.
    #[error("{what}: {found}; expected {min} to {max}")]
    CountOutOfRange {
        /// Counted item.
        what: &'static str,
        /// Count in the file.
        found: u32,
        /// Minimum count.
        min: u32,
        /// Maximum count.
        max: u32,
    },
    /// A record cannot be decoded.
    #[error("record {record} cannot be decoded")]
    BadRecord {
        /// Index of the record in its table.
        record: u32,
    },
    /// Kind, quantum or limits of a channel differ from those of the configuration.
    #[error("channel {channel}: kind, quantum or limits differ from the robot's configuration")]
    ChannelMismatch {
        /// Index of the channel.
        channel: u8,
    },
    /// A clip has too few frames, or more than the format allows.
    #[error("clip {}: {frames} frames; expected {min} to {MAX_CLIP_FRAMES}", clip.0)]
    ClipLength {
        /// The clip.
        clip: ClipId,
        /// Number of frames of the clip.
        frames: u16,
        /// Minimum number of frames of the clip: 2 for a transition, otherwise 1.
        min: u16,
    },
    /// A clip has unknown flags or an invalid attitude, is a transition that loops, or has blocks that do not follow one
    /// another.
    #[error("clip {}: invalid clip record", clip.0)]
    BadClip {
        /// The clip.
        clip: ClipId,
    },
    /// A block of frames is damaged or cannot be decoded.
    #[error("clip {}: frame {frame} cannot be decoded, because its block is damaged", clip.0)]
    BadBlock {
        /// The clip.
        clip: ClipId,
        /// First frame that could not be decoded.
        frame: u16,
    },
    /// A value or a torque is outside the limits of its channel.
    #[error(
        "clip {}, frame {frame}, channel {channel}: {value} is outside the limits {min} to {max} \
         (rad, rad/s for a wheel, N·m in the torques)",
        clip.0
    )]
    OutOfLimits {
        /// The clip.
        clip: ClipId,
        /// The frame.
        frame: u16,
        /// The channel.
        channel: u8,
        /// Value: rad for a joint, rad/s for a wheel, N·m for a torque.
        value: f32,
        /// Smallest value.
        min: f32,
        /// Largest value.
        max: f32,
    },
    /// A channel changes faster than its limit between two frames.
    #[error(
        "clip {}, frame {frame}, channel {channel}: the rate of change is {rate}, above the limit \
         of {limit} (rad/s, or rad/s² for a wheel)",
        clip.0,
        limit = Limit::AtMost(*max_rate)
    )]
    TooFast {
        /// The clip.
        clip: ClipId,
        /// Second of the two frames.
        frame: u16,
        /// The channel.
        channel: u8,
        /// Rate of change, rad/s or rad/s².
        rate: f32,
        /// Largest rate of change, rad/s or rad/s².
        max_rate: f32,
    },
    /// The last frame of a looping motion does not lead to its first one.
    #[error(
        "clip {}, channel {channel}: the step from the last to the first frame is {step}, above \
         the limit of {most} (rad, or rad/s for a wheel)",
        clip.0,
        most = Limit::AtMost(*max_step)
    )]
    SeamJump {
        /// The clip.
        clip: ClipId,
        /// The channel.
        channel: u8,
        /// Jump, rad or rad/s.
        step: f32,
        /// Largest step between frames, rad or rad/s.
        max_step: f32,
    },
    /// A motion ends with a turning wheel, which would keep turning.
    #[error("clip {} ends, but channel {channel}, a wheel, turns at {} rad/s in the last frame; \
        expected 0 rad/s", clip.0, Number::from(*speed))]
    EndsInMotion {
        /// The clip.
        clip: ClipId,
        /// The channel.
        channel: u8,
        /// Speed of the wheel, rad/s.
        speed: f32,
    },
    /// A transition joins nodes or frames that do not exist, or a motion to itself.
    #[error("transition {}: joins nodes or frames that do not exist, or a motion to itself", edge.0)]
    BadEdge {
        /// The transition.
        edge: EdgeId,
    },
    /// A transition leaves a non-looping motion before its last frame. No transition would then lead on from the end.
    #[error(
        "transition {}: leaves its source at frame {exit_frame}; expected the last frame, {last}, \
         because the source does not loop",
        edge.0
    )]
    ExitBeforeEnd {
        /// The transition.
        edge: EdgeId,
        /// Frame at which the transition leaves.
        exit_frame: u16,
        /// Frame at which it must leave.
        last: u16,
    },
    /// The first or last frame of a transition differs from the frame that it joins.
    #[error(
        "transition {}, channel {channel}: the {end} is {found}; expected {expected}, as in the \
         joined motion (rad, rad/s for a wheel, N·m for a torque)",
        edge.0
    )]
    EndMismatch {
        /// The transition.
        edge: EdgeId,
        /// "first frame" or "last frame"; "first torque" or "last torque" if torques differ.
        end: &'static str,
        /// The channel.
        channel: u8,
        /// Value in the transition.
        found: f32,
        /// Value in the motion.
        expected: f32,
    },
    /// A motion has no route to SAFE.
    #[error("motion {} has no route to the safe motion {}: add a transition", node.0, safe.0)]
    NoRouteToSafe {
        /// The motion.
        node: NodeId,
        /// The safe motion.
        safe: NodeId,
    },
    /// A route does not arrive, starts elsewhere, or is missing although it exists.
    #[error("the route from motion {} to motion {} is wrong", from.0, to.0)]
    BadRoute {
        /// First motion of the route.
        from: NodeId,
        /// Last motion of the route.
        to: NodeId,
    },
    /// A command code selects a motion that does not exist.
    #[error(
        "command code {code} selects motion {node}, but the library has only {motions} motions"
    )]
    CodeWithoutMotion {
        /// The code.
        code: u8,
        /// Number of the motion.
        node: u8,
        /// Number of motions of the library.
        motions: u8,
    },
    /// A command code is repeated, or out of order.
    #[error("command code {code} is used twice, or is out of order")]
    DuplicateCode {
        /// The code.
        code: u8,
    },
    /// A motion has two codes, so that another one lacks a code.
    #[error("motion {} has more than one command code", node.0)]
    MotionWithTwoCodes {
        /// The motion.
        node: NodeId,
    },
    /// The safe motion does not exist.
    #[error("the safe motion is number {found}, but the library has only {motions} motions")]
    NoSafeMotion {
        /// Number of the safe motion.
        found: u8,
        /// Number of motions of the library.
        motions: u8,
    },
    /// The safe motion does not come to rest in the safe pose.
    #[error(
        "channel {channel}: the safe motion must end in the safe pose, or hold the safe pose in \
         all its frames"
    )]
    SafeNotAtRest {
        /// The channel.
        channel: u8,
    },
    /// A name is empty, too long, or not valid text.
    #[error("the name of motion {} is empty, too long or not valid text", node.0)]
    BadName {
        /// The motion.
        node: NodeId,
    },
}

impl RejectReason {
    /// Code on the wire, whose meaning never changes.
    pub fn code(&self) -> u8 {
        match self {
            RejectReason::NotALibrary => 1,
            RejectReason::Truncated { .. } => 2,
            RejectReason::TrailingBytes { .. } => 3,
            RejectReason::Corrupted { .. } => 4,
            RejectReason::OtherMajor { .. } => 5,
            RejectReason::SectionBeyondEnd => 6,
            RejectReason::BadSection { .. } => 7,
            RejectReason::MissingSection { .. } => 8,
            RejectReason::BadConfig(_) => 9,
            RejectReason::WrongRobot { .. } => 10,
            RejectReason::WrongRate { .. } => 11,
            RejectReason::WrongCount { .. } => 12,
            RejectReason::CountOutOfRange { .. } => 13,
            RejectReason::BadRecord { .. } => 14,
            RejectReason::ChannelMismatch { .. } => 15,
            RejectReason::ClipLength { .. } => 16,
            RejectReason::BadClip { .. } => 17,
            RejectReason::BadBlock { .. } => 18,
            RejectReason::OutOfLimits { .. } => 19,
            RejectReason::TooFast { .. } => 20,
            RejectReason::SeamJump { .. } => 21,
            RejectReason::EndsInMotion { .. } => 22,
            RejectReason::BadEdge { .. } => 23,
            RejectReason::ExitBeforeEnd { .. } => 24,
            RejectReason::EndMismatch { .. } => 25,
            RejectReason::NoRouteToSafe { .. } => 26,
            RejectReason::BadRoute { .. } => 27,
            RejectReason::CodeWithoutMotion { .. } => 28,
            RejectReason::DuplicateCode { .. } => 29,
            RejectReason::MotionWithTwoCodes { .. } => 30,
            RejectReason::NoSafeMotion { .. } => 31,
            RejectReason::SafeNotAtRest { .. } => 32,
            RejectReason::BadName { .. } => 33,
        }
    }
}
