//! The read view of a validated library, and the proof of validation that opens it.

use super::attitude::Attitude;
use super::container::{FOOTER_LEN, SECTIONS, Span, u16_at, u32_at};
use super::records::{AttitudeRecord, CLIP_LEN, CodeRecord, EdgeRecord, FLAG_LOOPING};
use super::reject::Section;
use super::{ClipId, EdgeId, NO_EDGE, NodeId, quantise, records};
use crate::config::MAX_CHANNELS;
use serde::de::DeserializeOwned;

/// Proof that some bytes are a valid library for a robot, and where its tables are.
///
/// Only [`validate`](super::validate) makes one. It borrows nothing, so that it can be kept next to
/// the store that holds the bytes. Its owner must drop it when it changes them; if it does not,
/// [`Library::open`] and the next CRC of a block of frames notice, and nothing panics.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Index {
    pub(super) len: u32,
    pub(super) id: u32,
    /// CRC in the footer: comparing it shows quickly if the bytes are still the same.
    pub(super) body_crc: u32,
    pub(super) config_hash: u32,
    pub(super) sections: [Span; SECTIONS],
    pub(super) channels: u8,
    pub(super) motions: u8,
    pub(super) transitions: u8,
    pub(super) safe_node: u8,
    pub(super) lsb_exponents: [i8; MAX_CHANNELS],
    pub(super) torque_exponents: [i8; MAX_CHANNELS],
}

impl Index {
    /// Identity of the library: the [digest](crate::crc::file_digest) of all its bytes. HELLO contains it, and a status message
    /// its lowest byte.
    pub fn id(&self) -> u32 {
        self.id
    }

    /// Bytes of the library.
    pub fn len_bytes(&self) -> u32 {
        self.len
    }

    /// Hash of the robot's configuration that the library was built for and validated against.
    pub fn config_hash(&self) -> u32 {
        self.config_hash
    }
}

/// Quantity of every channel in the blocks of a section.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Track {
    Values,
    Torques,
}

impl Track {
    pub const ALL: [Self; 2] = [Self::Values, Self::Torques];

    /// Section with the blocks.
    pub fn blocks(self) -> Section {
        match self {
            Self::Values => Section::Frames,
            Self::Torques => Section::Torques,
        }
    }

    /// Section with the positions of each clip's blocks.
    pub fn clips(self) -> Section {
        match self {
            Self::Values => Section::Clips,
            Self::Torques => Section::TorqueClips,
        }
    }
}

/// Kind of a clip.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ClipKind {
    /// A node of the graph.
    Motion,
    /// An edge of the graph.
    Transition,
}

/// Facts about a clip.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ClipInfo {
    /// Motion or transition.
    pub kind: ClipKind,
    /// Frames at 60 Hz.
    pub frames: u16,
    /// The last frame is followed by the first one.
    pub looping: bool,
    /// Command code; `None` for a transition.
    pub code: Option<u8>,
    /// Bytes of its frames in the library, those of the torques included.
    pub bytes: u32,
}

/// A transition from a frame of a motion to a frame of another.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Edge {
    /// The clip to play between.
    pub clip: ClipId,
    /// Source.
    pub from: NodeId,
    /// Frame of the source that is the transition's first frame.
    pub exit_frame: u16,
    /// Target.
    pub to: NodeId,
    /// Frame of the target that is the transition's last frame.
    pub entry_frame: u16,
}

/// A validated library, ready to be read. Cheap to make: open it wherever it is needed.
///
/// All lookups take constant time, or time in the number of motions for names and codes. `None`
/// means a number that does not exist.
#[derive(Clone, Copy, Debug)]
pub struct Library<'a> {
    bytes: &'a [u8],
    index: Index,
}

impl<'a> Library<'a> {
    /// The view of bytes that were validated. `None` when they are evidently other bytes than those
    /// that `index` is about (their lengths or the CRCs in their footers differ).
    pub fn open(bytes: &'a [u8], index: &Index) -> Option<Self> {
        let footer = bytes.len().checked_sub(FOOTER_LEN)?;
        let same = bytes.len() as u64 == u64::from(index.len)
            && u32_at(bytes, footer.checked_add(12)?) == Some(index.body_crc);
        same.then_some(Self::unchecked(bytes, *index))
    }

    /// View without checks, for the validator, which reads through the same code as the player.
    pub(super) fn unchecked(bytes: &'a [u8], index: Index) -> Self {
        Self { bytes, index }
    }

    /// The whole file.
    pub fn bytes(&self) -> &'a [u8] {
        self.bytes
    }

    /// The proof that opened this view.
    pub fn index(&self) -> &Index {
        &self.index
    }

    /// True if there are torques with the frames.
    pub fn has_torques(&self) -> bool {
        self.tracks().len() > 1
    }

    /// The tracks that there are.
    pub(super) fn tracks(&self) -> &'static [Track] {
        // A section that is there has a stride.
        let has_torques = self.span(Section::Torques).is_some_and(|span| span.stride > 0);
        if has_torques { &Track::ALL } else { &[Track::Values] }
    }

    /// Joints and wheels of a frame.
    pub fn channel_count(&self) -> usize {
        usize::from(self.index.channels)
    }

    /// Motions and transitions.
    pub fn clip_count(&self) -> u8 {
        self.index.motions.saturating_add(self.index.transitions)
    }

    /// Nodes of the graph: the motions.
    pub fn node_count(&self) -> u8 {
        self.index.motions
    }

    /// Motions of the library.
    pub fn nodes(&self) -> impl Iterator<Item = NodeId> + use<> {
        (0..self.index.motions).map(NodeId)
    }

    /// Transitions of the library.
    pub fn edges(&self) -> impl Iterator<Item = EdgeId> + use<> {
        (0..self.index.transitions).map(EdgeId)
    }

    /// Facts about a clip.
    pub fn clip(&self, clip: ClipId) -> Option<ClipInfo> {
        let record = self.clip_record(clip)?;
        let motion = clip.0 < self.index.motions;
        Some(ClipInfo {
            kind: if motion { ClipKind::Motion } else { ClipKind::Transition },
            frames: record.frames,
            looping: record.flags & FLAG_LOOPING != 0,
            code: if motion { self.code_of(NodeId(clip.0)) } else { None },
            bytes: (self.tracks().iter())
                .filter_map(|&track| self.clip_span(track, clip))
                .fold(0, |sum, (_, len)| sum.saturating_add(len)),
        })
    }

    /// Direction of up during a clip; `None` when the library does not contain it.
    pub fn attitude(&self, clip: ClipId) -> Option<Attitude> {
        if clip.0 >= self.clip_count() {
            return None;
        }
        let span = self.span(Section::Clips)?;
        let record = span.record(self.bytes, usize::from(clip.0))?.get(usize::from(CLIP_LEN)..)?;
        // Libraries of format 1.0, and clips without an attitude, end here.
        AttitudeRecord::read(record).as_ref().and_then(Attitude::of)
    }

    /// The motion that a command code asks for.
    pub fn node_for_code(&self, code: u8) -> Option<NodeId> {
        self.codes().find(|record| record.code == code).map(|record| NodeId(record.node))
    }

    /// The command code of a motion.
    pub fn code_of(&self, node: NodeId) -> Option<u8> {
        self.codes().find(|record| record.node == node.0).map(|record| record.code)
    }

    /// The transition to take first on the shortest way from one motion to another; `None` when
    /// there is no way. From a motion to itself: the shortest way round, to play it once more.
    pub fn next_hop(&self, from: NodeId, to: NodeId) -> Option<EdgeId> {
        let n = usize::from(self.index.motions);
        if usize::from(from.0) >= n || usize::from(to.0) >= n {
            return None;
        }
        let cell = usize::from(from.0) * n + usize::from(to.0);
        let edge = *self.payload(Section::Routes)?.get(cell)?;
        (edge != NO_EDGE).then_some(EdgeId(edge))
    }

    /// A transition.
    pub fn edge(&self, edge: EdgeId) -> Option<Edge> {
        if edge.0 >= self.index.transitions {
            return None;
        }
        let record: EdgeRecord = self.record(Section::Edges, usize::from(edge.0))?;
        Some(Edge {
            clip: ClipId(self.index.motions.checked_add(edge.0)?),
            from: NodeId(record.from),
            exit_frame: record.exit_frame,
            to: NodeId(record.to),
            entry_frame: record.entry_frame,
        })
    }

    /// The motion that every motion has a route to. It comes to rest in the safe pose: start it at
    /// its last frame when the robot stands in that pose.
    pub fn safe_node(&self) -> NodeId {
        NodeId(self.index.safe_node)
    }

    /// Writes the safe pose: joint angles in rad, wheels at 0 rad/s. `None` when `out` is shorter
    /// than [`channel_count`](Self::channel_count); more elements are left alone.
    pub fn safe_pose_into(&self, out: &mut [f32]) -> Option<()> {
        let pose = self.payload(Section::SafePose)?;
        for (i, slot) in out.get_mut(..self.channel_count())?.iter_mut().enumerate() {
            let quanta = u16_at(pose, i.checked_mul(2)?)? as i16;
            *slot = self.value(i, i32::from(quanta))?;
        }
        Some(())
    }

    /// The size of a quantum of a channel: rad for a joint, rad/s for a wheel.
    pub fn quantum(&self, channel: usize) -> Option<f32> {
        self.value(channel, 1)
    }

    /// The size of a quantum of a channel's torques, N·m.
    pub fn torque_quantum(&self, channel: usize) -> Option<f32> {
        self.track_value(Track::Torques, channel, 1)
    }

    /// Name of a motion. `None` for a motion that does not exist.
    pub fn name(&self, node: NodeId) -> Option<&'a str> {
        let mut rest = self.payload(Section::Names)?;
        for _ in 0..node.0 {
            rest = postcard::take_from_bytes::<&str>(rest).ok()?.1;
        }
        postcard::take_from_bytes::<&str>(rest).ok().map(|(name, _)| name)
    }

    /// Value of some quanta of a channel.
    pub(super) fn value(&self, channel: usize, quanta: i32) -> Option<f32> {
        self.track_value(Track::Values, channel, quanta)
    }

    /// The same of a track.
    pub(super) fn track_value(&self, track: Track, channel: usize, quanta: i32) -> Option<f32> {
        if channel >= self.channel_count() {
            return None;
        }
        let exponents = match track {
            Track::Values => &self.index.lsb_exponents,
            Track::Torques => &self.index.torque_exponents,
        };
        Some(quantise::value(quanta, *exponents.get(channel)?))
    }

    /// Offset of a clip's first block in the track's section, and the number of bytes of its blocks.
    pub(super) fn clip_span(&self, track: Track, clip: ClipId) -> Option<(u32, u32)> {
        let record = self.span(track.clips())?.record(self.bytes, usize::from(clip.0))?;
        // Frames are behind flags and count.
        let at = if track == Track::Values { 3 } else { 0 };
        Some((u32_at(record, at)?, u32_at(record, at + 4)?))
    }

    pub(super) fn clip_record(&self, clip: ClipId) -> Option<records::ClipRecord> {
        if clip.0 >= self.clip_count() {
            return None;
        }
        self.record(Section::Clips, usize::from(clip.0))
    }

    fn span(&self, section: Section) -> Option<&Span> {
        self.index.sections.get(section.index()?)
    }

    pub(super) fn payload(&self, section: Section) -> Option<&'a [u8]> {
        self.span(section)?.of(self.bytes)
    }

    pub(super) fn record<T: DeserializeOwned>(&self, section: Section, i: usize) -> Option<T> {
        let record = self.span(section)?.record(self.bytes, i)?;
        postcard::take_from_bytes(record).ok().map(|(value, _)| value)
    }

    fn codes(&self) -> impl Iterator<Item = CodeRecord> {
        (0..usize::from(self.index.motions)).filter_map(|i| self.record(Section::Codes, i))
    }
}
