//! Reasons for refusing a library, as values that read as sentences.

use super::{ClipId, EdgeId, FORMAT_MAJOR, MAX_CLIP_FRAMES, NodeId, RATE_HZ};
use crate::text::{Limit, Number};
use core::fmt;
use thiserror::Error;

/// A library that must not be played, with the position of the fault and the reason.
#[derive(Clone, Copy, Debug, PartialEq, Error)]
#[error("{section} at byte {offset}: {why}")]
pub struct Reject {
    /// Part of the file.
    pub section: Section,
    /// Bytes from the start of the file.
    pub offset: u32,
    /// The reason.
    pub why: Why,
}

/// A part of a library file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Section {
    /// Fixed header.
    Header,
    /// The sequence of sections.
    Table,
    /// Counts, rate, robot.
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
    /// Tag in the file; `None` for the parts that have none.
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
    /// Number on the wire: the section's tag, 0 for header and section table, 255 for the footer.
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
pub enum Why {
    /// The magic bytes are not there.
    #[error("this is not a motion library")]
    NotALibrary,
    /// Fewer bytes than the header says.
    #[error("truncated: {len} bytes of {expected}")]
    Truncated {
        /// Bytes there are.
        len: u64,
        /// Bytes there should be.
        expected: u64,
    },
    /// More bytes than the header says.
    #[error("{len} bytes where the header says {expected}: something follows the library")]
    TrailingBytes {
        /// Bytes there are.
        len: u64,
        /// Bytes there should be.
        expected: u64,
    },
    /// A checksum does not fit.
    #[error("corrupted: CRC-32C is {computed:#010x}, stored was {stored:#010x}")]
    Corrupted {
        /// Checksum in the file.
        stored: u32,
        /// Checksum of the bytes read.
        computed: u32,
    },
    /// Another major version of the format.
    #[error(
        "format version {found}, but this reader knows version {FORMAT_MAJOR}: build the library \
         and the firmware from the same release"
    )]
    OtherMajor {
        /// Major version of the file.
        found: u16,
    },
    /// A section reaches beyond the end.
    #[error("a section reaches beyond the end of the file")]
    SectionBeyondEnd,
    /// A section out of order, twice, unknown to this minor version, or of broken size.
    #[error("section {tag} is out of order, repeated, unknown or of broken size")]
    BadSection {
        /// Tag of the section.
        tag: u16,
    },
    /// A section that every library has is missing.
    #[error("section {tag} is missing")]
    MissingSection {
        /// Tag of the section.
        tag: u16,
    },
    /// The configuration of the reader itself is unusable.
    #[error("the robot's configuration is unusable: {0}")]
    BadConfig(crate::config::ConfigError),
    /// Built for another robot, or for other limits of this one.
    #[error(
        "built for another robot: configuration hash {library:#010x}, this robot has \
         {robot:#010x}; build the library again from this robot's file"
    )]
    WrongRobot {
        /// Hash in the library.
        library: u32,
        /// Hash of the robot's configuration.
        robot: u32,
    },
    /// Frame rate other than 60 Hz.
    #[error("frame rate is {found} Hz, must be {RATE_HZ} Hz")]
    WrongRate {
        /// Rate of the file.
        found: u16,
    },
    /// A record cannot be read, or a table has another number of records than the manifest says.
    #[error("{found} records, the manifest asks for {expected}")]
    WrongCount {
        /// Records there are.
        found: u32,
        /// Records there should be.
        expected: u32,
    },
    /// Count of zero where a motion is needed, or beyond the room of a reader.
    #[error("{what}: {found}, must be {min} to {max}")]
    CountOutOfRange {
        /// Item counted.
        what: &'static str,
        /// Count in the file.
        found: u32,
        /// Fewest.
        min: u32,
        /// Most.
        max: u32,
    },
    /// A record that does not decode.
    #[error("record {record} does not decode")]
    BadRecord {
        /// Number of the record in its table.
        record: u32,
    },
    /// Kind, quantum or limits of a channel differ from the configuration's.
    #[error("channel {channel}: kind, quantum or limits differ from the robot's configuration")]
    ChannelMismatch {
        /// Number of the channel.
        channel: u8,
    },
    /// A clip without frames, or longer than the format allows.
    #[error("clip {}: {frames} frames, must be {min} to {MAX_CLIP_FRAMES}", clip.0)]
    ClipLength {
        /// The clip.
        clip: ClipId,
        /// Frames of the clip.
        frames: u16,
        /// Fewest frames of such a clip.
        min: u16,
    },
    /// Unknown flags, a transition that loops, or blocks that do not follow one another.
    #[error("clip {}: broken clip record", clip.0)]
    BadClip {
        /// The clip.
        clip: ClipId,
    },
    /// A block of frames that does not decode or is damaged.
    #[error("clip {}: frame {frame} cannot be decoded, its block is broken", clip.0)]
    BadBlock {
        /// The clip.
        clip: ClipId,
        /// First frame that could not be had.
        frame: u16,
    },
    /// A frame outside a channel's limits, or a torque.
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
        /// Value, rad or rad/s; N·m in the torques.
        value: f32,
        /// Smallest value.
        min: f32,
        /// Largest value.
        max: f32,
    },
    /// A change from the frame before that is faster than the channel's limit.
    #[error(
        "clip {}, frame {frame}, channel {channel}: changes at {rate} per second, limit is \
         {limit} (rad/s, or rad/s² for a wheel)",
        clip.0,
        limit = Limit::AtMost(*max_rate)
    )]
    TooFast {
        /// The clip.
        clip: ClipId,
        /// The frame that is reached too fast.
        frame: u16,
        /// The channel.
        channel: u8,
        /// Change per second, rad/s or rad/s².
        rate: f32,
        /// Largest change per second.
        max_rate: f32,
    },
    /// The last frame of a looping motion does not lead to its first one.
    #[error(
        "clip {}, channel {channel}: jumps by {step} from its last frame to its first, largest \
         step is {most} (rad, or rad/s for a wheel)",
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
        /// Largest step of a frame.
        max_step: f32,
    },
    /// A motion that ends with a turning wheel would leave it turning for ever.
    #[error("clip {} ends, but channel {channel}, a wheel, turns at {} rad/s in its last frame", clip.0, Number::from(*speed))]
    EndsInMotion {
        /// The clip.
        clip: ClipId,
        /// The channel.
        channel: u8,
        /// Speed, rad/s.
        speed: f32,
    },
    /// A transition from or to a node or a frame that does not exist, or to its own source.
    #[error("transition {}: joins nodes or frames that do not exist, or a motion to itself", edge.0)]
    BadEdge {
        /// The transition.
        edge: EdgeId,
    },
    /// A transition that leaves a motion that ends, before its end: after the end nothing would
    /// lead on.
    #[error(
        "transition {}: leaves its source at frame {exit_frame}, but a motion that ends is left \
         at its last frame, {last}",
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
    /// A transition whose end is not the frame that it joins.
    #[error(
        "transition {}, channel {channel}: its {end} is {found}, the motion that it joins is at \
         {expected} (rad, rad/s for a wheel, N·m of a torque)",
        edge.0
    )]
    EndMismatch {
        /// The transition.
        edge: EdgeId,
        /// "first frame" or "last frame", or the torque there.
        end: &'static str,
        /// The channel.
        channel: u8,
        /// Value in the transition.
        found: f32,
        /// Value in the motion.
        expected: f32,
    },
    /// A motion from which SAFE cannot be reached.
    #[error("motion {} has no route to the safe motion {}: add a transition", node.0, safe.0)]
    NoRouteToSafe {
        /// The motion.
        node: NodeId,
        /// The safe motion.
        safe: NodeId,
    },
    /// A route that does not arrive, starts elsewhere, or is missing although there is one.
    #[error("the route from motion {} to motion {} is wrong", from.0, to.0)]
    BadRoute {
        /// Start.
        from: NodeId,
        /// Goal.
        to: NodeId,
    },
    /// A command code that leads to a motion that does not exist.
    #[error("command code {code} asks for motion {node}, there are {motions}")]
    CodeWithoutMotion {
        /// The code.
        code: u8,
        /// Number of the motion.
        node: u8,
        /// Motions of the library.
        motions: u8,
    },
    /// A command code twice, or out of order.
    #[error("command code {code} is used twice (or out of order)")]
    DuplicateCode {
        /// The code.
        code: u8,
    },
    /// A motion with two codes, while another has none.
    #[error("motion {} has more than one command code", node.0)]
    MotionWithTwoCodes {
        /// The motion.
        node: NodeId,
    },
    /// The safe motion does not exist.
    #[error("the safe motion is number {found}, there are {motions} motions")]
    NoSafeMotion {
        /// Number of the safe motion.
        found: u8,
        /// Motions of the library.
        motions: u8,
    },
    /// The safe motion never comes to rest in the safe pose.
    #[error(
        "channel {channel}: the safe motion does not come to rest in the safe pose: it must end, \
         or hold still in all its frames"
    )]
    SafeNotAtRest {
        /// The channel.
        channel: u8,
    },
    /// A name that is no text, empty or too long.
    #[error("the name of motion {} is no text, empty or too long", node.0)]
    BadName {
        /// The motion.
        node: NodeId,
    },
}

impl Why {
    /// Number on the wire; never changes its meaning.
    pub fn code(&self) -> u8 {
        match self {
            Why::NotALibrary => 1,
            Why::Truncated { .. } => 2,
            Why::TrailingBytes { .. } => 3,
            Why::Corrupted { .. } => 4,
            Why::OtherMajor { .. } => 5,
            Why::SectionBeyondEnd => 6,
            Why::BadSection { .. } => 7,
            Why::MissingSection { .. } => 8,
            Why::BadConfig(_) => 9,
            Why::WrongRobot { .. } => 10,
            Why::WrongRate { .. } => 11,
            Why::WrongCount { .. } => 12,
            Why::CountOutOfRange { .. } => 13,
            Why::BadRecord { .. } => 14,
            Why::ChannelMismatch { .. } => 15,
            Why::ClipLength { .. } => 16,
            Why::BadClip { .. } => 17,
            Why::BadBlock { .. } => 18,
            Why::OutOfLimits { .. } => 19,
            Why::TooFast { .. } => 20,
            Why::SeamJump { .. } => 21,
            Why::EndsInMotion { .. } => 22,
            Why::BadEdge { .. } => 23,
            Why::ExitBeforeEnd { .. } => 24,
            Why::EndMismatch { .. } => 25,
            Why::NoRouteToSafe { .. } => 26,
            Why::BadRoute { .. } => 27,
            Why::CodeWithoutMotion { .. } => 28,
            Why::DuplicateCode { .. } => 29,
            Why::MotionWithTwoCodes { .. } => 30,
            Why::NoSafeMotion { .. } => 31,
            Why::SafeNotAtRest { .. } => 32,
            Why::BadName { .. } => 33,
        }
    }
}
