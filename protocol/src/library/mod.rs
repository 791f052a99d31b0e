//! Motion library (`.rwl`): all motions of a robot at 60 Hz, the transitions that join them, and the graph with the routes
//! between motions and to SAFE.
//!
//! ```text
//! LibrarySpec --encode--> bytes --validate(config)--> Index --Library::open(bytes, &index)--> Library
//!                                                                                             │
//!                       ClipCursor: sequential frames, seek, 16 B per possible channel <──┘
//! ```
//!
//! - [`encode`] quantises, packs, computes the routes and validates its own output.
//! - [`validate`] checks everything once, and returns an [`Index`] as proof. The index is a small `Copy` token without a
//!   borrow, so that its owner may also own the store that contains the bytes.
//! - [`Library`] is the read view. It can only be created from bytes with their index.
//! - [`ClipCursor`] decodes frames, and borrows nothing.
//!
//! # Terms
//!
//! - **Frame**: one value for each channel of the robot, every 1/60 s.
//! - **Torque**: effort that the motion requires of a channel's actuator in a frame. A library has torques for all clips, or
//!   for none of them.
//! - **Motion**: a clip with a command code, and a node of the graph. The motion clip with number `i` is node `i`.
//! - **Transition**: a clip that leads from one motion to another, and an edge of the graph. Its first frame *is* the exit frame
//!   of the source, and its last frame *is* the entry frame of the target, bit for bit. Playback leaves the source at its exit
//!   frame, and continues with frame 1 of the transition. After the last frame of the transition it continues with frame
//!   `entry_frame + 1` of the target.
//! - **Looping** motion of n frames: frame 0 follows frame n−1.
//! - **Motion that ends**: stays at its last frame, in which every wheel stands still, and is left from there.
//! - **SAFE**: the motion to which every motion has a route. It comes to rest in the safe pose.
//!
//! The byte format is normative in `docs/formats/motion-library.md`.

mod attitude;
mod block;
mod codec;
mod container;
mod cursor;
mod decoder;
mod encode;
mod entry;
mod place;
mod quantise;
mod records;
mod reject;
mod routes;
mod signature;
mod source;
mod spec;
mod validate;
mod validate_graph;
mod view;
mod writer;

pub use attitude::{Attitude, MAX_TILT_RAD};
pub use block::LibraryReadError;
pub use container::identity;
pub use cursor::{Advance, ClipCursor};
pub use encode::{encode, encode_with_attitudes};
pub use entry::Entry;
pub use place::{PlaceCode, place_of};
pub use reject::{Reject, RejectReason, Section};
pub use signature::{
    FINGERPRINT_LEN, SIGNATURE_BLOCK_LEN, SIGNATURE_LEN, SIGNATURE_MAGIC, SignedFile,
    signature_head,
};
pub use spec::{
    ClipRef, EncodeError, JOIN_TOLERANCE_RAD, LibrarySpec, MotionSpec, TORQUE_BLEND_FRAMES,
    TransitionSpec,
};
pub use validate::validate;
pub use view::{ClipInfo, ClipKind, Edge, Index, Library};

/// Frame rate, Hz: the only rate of format 1.
pub const RATE_HZ: u16 = 60;
/// Major format version. Readers refuse any other.
pub const FORMAT_MAJOR: u16 = 1;
/// Minor format version. Readers skip the sections and record fields of a higher one.
pub const FORMAT_MINOR: u16 = 2;
/// Maximum number of motions (nodes) of a library.
pub const MAX_MOTIONS: usize = 32;
/// Maximum number of transitions (edges) of a library.
pub const MAX_TRANSITIONS: usize = 96;
/// Maximum number of clips of a library. Motions come first, then transitions.
pub const MAX_CLIPS: usize = MAX_MOTIONS + MAX_TRANSITIONS;
/// Maximum length of a clip, frames: one minute, which fits in the 12 bits of a status message.
pub const MAX_CLIP_FRAMES: u16 = 3600;
/// Number of frames from one keyframe to the next. Decoding can start at a keyframe.
pub const BLOCK_FRAMES: u16 = 60;
/// Maximum length of a motion's name, bytes of UTF-8.
pub const MAX_NAME: usize = 32;

/// Marker for "no route" and "no transition" in tables of transitions.
pub(crate) const NO_EDGE: u8 = 0xFF;

const _: () = {
    assert!(MAX_CLIPS <= 255, "a clip number is a byte and 255 means none");
    assert!(MAX_TRANSITIONS < NO_EDGE as usize, "an edge number is a byte and 255 means none");
    assert!(MAX_CLIP_FRAMES < 1 << 12, "a status message has 12 bits for the frame");
    assert!(BLOCK_FRAMES < 256, "a block counts its frames in a byte");
};

/// Number of a clip: motions from 0, then transitions.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct ClipId(pub u8);

/// Number of a node of the motion graph.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct NodeId(pub u8);

/// Number of an edge of the motion graph.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct EdgeId(pub u8);

impl NodeId {
    /// Motion clip that is played at this node.
    pub fn clip(self) -> ClipId {
        ClipId(self.0)
    }
}
