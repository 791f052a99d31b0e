//! Read view of a validated library, and the proof of validation that opens it.

use super::attitude::Attitude;
use super::container::{FOOTER_LEN, SECTIONS, Span, u16_at, u32_at};
use super::records::{AttitudeRecord, CLIP_LEN, CodeRecord, EdgeRecord, FLAG_LOOPING};
use super::reject::Section;
use super::{ClipId, EdgeId, NO_EDGE, NodeId, quantise, records};
use crate::config::MAX_CHANNELS;
use serde::de::DeserializeOwned;

/// Proof that some bytes are a valid library for a robot, with the positions of its tables.
///
/// Only [`validate`](super::validate) creates an index. It borrows nothing, so that it can be kept next to the store that
/// contains the bytes. The owner must drop the index when the bytes change. Otherwise [`Library::open`] and the next CRC check
/// of a block of frames detect the change, and nothing panics.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Index {
    pub(super) len: u32,
    pub(super) id: u32,
    /// CRC in the footer. Comparing it is a quick check that the bytes are unchanged.
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
    /// Identity of the library: the [digest](crate::crc::file_digest) of all its bytes. HELLO contains the identity, and a
    /// status message contains its lowest byte.
    pub fn id(&self) -> u32 {
        self.id
    }

    /// Size of the library, bytes.
    pub fn len_bytes(&self) -> u32 {
        self.len
    }

    /// Hash of the robot's configuration that the library was built for and validated against.
    pub fn config_hash(&self) -> u32 {
        self.config_hash
    }
}

/// Quantity that the blocks of a section contain for every channel.
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
    /// Node of the graph.
    Motion,
    /// Edge of the graph.
    Transition,
}

/// Properties of a clip.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ClipInfo {
    /// Motion or transition.
    pub kind: ClipKind,
    /// Number of frames, at 60 Hz.
    pub frames: u16,
    /// True if the first frame follows the last.
    pub looping: bool,
    /// Command code; `None` for a transition.
    pub code: Option<u8>,
    /// Size of the clip's frames in the library, bytes, torques included.
    pub bytes: u32,
}

/// Transition from a frame of a motion to a frame of another.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Edge {
    /// Clip of the transition.
    pub clip: ClipId,
    /// Source motion.
    pub from: NodeId,
    /// Frame of the source that equals the transition's first frame.
    pub exit_frame: u16,
    /// Target motion.
    pub to: NodeId,
    /// Frame of the target that equals the transition's last frame.
    pub entry_frame: u16,
}

/// Read view of a validated library. Views are cheap: open one wherever it is needed.
///
/// Lookups of names and codes take time proportional to the number of motions. Other lookups take constant time. A lookup
/// returns `None` for a number that does not exist.
#[derive(Clone, Copy, Debug)]
pub struct Library<'a> {
    bytes: &'a [u8],
    index: Index,
}

impl<'a> Library<'a> {
    /// Opens validated bytes. `None` if their length or the CRC in their footer shows that `index` belongs to other bytes.
    pub fn open(bytes: &'a [u8], index: &Index) -> Option<Self> {
        let footer = bytes.len().checked_sub(FOOTER_LEN)?;
        let same = bytes.len() as u64 == u64::from(index.len)
            && u32_at(bytes, footer.checked_add(12)?) == Some(index.body_crc);
        same.then_some(Self::unchecked(bytes, *index))
    }

    /// Creates a view without checks, for the validator, which reads with the code of the player.
    pub(super) fn unchecked(bytes: &'a [u8], index: Index) -> Self {
        Self { bytes, index }
    }

    /// Bytes of the library.
    pub fn bytes(&self) -> &'a [u8] {
        self.bytes
    }

    /// Proof of validation that opened this view.
    pub fn index(&self) -> &Index {
        &self.index
    }

    /// True if the library has torques.
    pub fn has_torques(&self) -> bool {
        self.tracks().len() > 1
    }

    /// Tracks of the library.
    pub(super) fn tracks(&self) -> &'static [Track] {
        // A missing section has a stride of 0.
        let has_torques = self.span(Section::Torques).is_some_and(|span| span.stride > 0);
        if has_torques { &Track::ALL } else { &[Track::Values] }
    }

    /// Number of channels: joints and wheels.
    pub fn channel_count(&self) -> usize {
        usize::from(self.index.channels)
    }

    /// Number of clips: motions and transitions.
    pub fn clip_count(&self) -> u8 {
        self.index.motions.saturating_add(self.index.transitions)
    }

    /// Number of nodes of the graph, which are the motions.
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

    /// Properties of a clip.
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

    /// Direction of up during a clip; `None` if the library does not contain it.
    pub fn attitude(&self, clip: ClipId) -> Option<Attitude> {
        if clip.0 >= self.clip_count() {
            return None;
        }
        let span = self.span(Section::Clips)?;
        let record = span.record(self.bytes, usize::from(clip.0))?.get(usize::from(CLIP_LEN)..)?;
        // Libraries of format 1.0, and clips without an attitude, end here.
        AttitudeRecord::read(record).as_ref().and_then(Attitude::of)
    }

    /// Motion that a command code selects.
    pub fn node_for_code(&self, code: u8) -> Option<NodeId> {
        self.codes().find(|record| record.code == code).map(|record| NodeId(record.node))
    }

    /// Command code of a motion.
    pub fn code_of(&self, node: NodeId) -> Option<u8> {
        self.codes().find(|record| record.node == node.0).map(|record| record.code)
    }

    /// First transition of the shortest route from one motion to another; `None` if there is no route. From a motion to itself,
    /// the route is the shortest round trip, which plays the motion once more.
    pub fn next_hop(&self, from: NodeId, to: NodeId) -> Option<EdgeId> {
        let n = usize::from(self.index.motions);
        if usize::from(from.0) >= n || usize::from(to.0) >= n {
            return None;
        }
        let cell = usize::from(from.0) * n + usize::from(to.0);
        let edge = *self.payload(Section::Routes)?.get(cell)?;
        (edge != NO_EDGE).then_some(EdgeId(edge))
    }

    /// Transition with the number `edge`.
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

    /// SAFE motion, to which every motion has a route. The motion comes to rest in the safe pose. If the robot stands in that
    /// pose, start the motion at its last frame.
    pub fn safe_node(&self) -> NodeId {
        NodeId(self.index.safe_node)
    }

    /// Writes the safe pose to the beginning of `out`: joint angles in rad, wheels at 0 rad/s. Further elements of `out` keep
    /// their values. `None` if `out` is shorter than [`channel_count`](Self::channel_count).
    pub fn safe_pose_into(&self, out: &mut [f32]) -> Option<()> {
        let pose = self.payload(Section::SafePose)?;
        for (i, slot) in out.get_mut(..self.channel_count())?.iter_mut().enumerate() {
            let quanta = u16_at(pose, i.checked_mul(2)?)? as i16;
            *slot = self.value(i, i32::from(quanta))?;
        }
        Some(())
    }

    /// Size of a quantum of a channel: rad for a joint, rad/s for a wheel.
    pub fn quantum(&self, channel: usize) -> Option<f32> {
        self.value(channel, 1)
    }

    /// Size of a quantum of a channel's torques, N·m.
    pub fn torque_quantum(&self, channel: usize) -> Option<f32> {
        self.track_value(Track::Torques, channel, 1)
    }

    /// Name of a motion; `None` if the motion does not exist.
    pub fn name(&self, node: NodeId) -> Option<&'a str> {
        let mut names = ("", self.payload(Section::Names)?);
        for _ in 0..=node.0 {
            names = postcard::take_from_bytes::<&str>(names.1).ok()?;
        }
        Some(names.0)
    }

    /// Value of `quanta` of a channel, rad or rad/s.
    pub(super) fn value(&self, channel: usize, quanta: i32) -> Option<f32> {
        self.track_value(Track::Values, channel, quanta)
    }

    /// Value of `quanta` of a channel in a track; N·m in the track of torques.
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

    /// Offset of a clip's first block in the track's section, and total length of its blocks, bytes.
    pub(super) fn clip_span(&self, track: Track, clip: ClipId) -> Option<(u32, u32)> {
        let record = self.span(track.clips())?.record(self.bytes, usize::from(clip.0))?;
        // A record of values begins with flags and number of frames.
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
