//! The motion library (`.rwl`): every motion of a robot at 60 Hz, the transitions that join them,
//! and the graph to walk from any of them to any other and to SAFE.
//!
//! ```text
//! LibrarySpec --encode--> bytes --validate(config)--> Index --Library::open(bytes, &index)--> Library
//!                                                                                             │
//!                  ClipCursor: sequential frames, seek, 8 B a channel, 16 B with torques <──┘
//! ```
//!
//! - [`encode`] quantises, packs, works out the routes and validates its own result.
//! - [`validate`] walks everything once. The [`Index`] that it returns is the proof, a small `Copy`
//!   token without borrow, so that its owner may also own the store that the bytes live in.
//! - [`Library`] is the read view. It only comes into being from bytes with their index.
//! - [`ClipCursor`] decodes frames. It borrows nothing either.
//!
//! # Terms
//!
//! - **Frame**: one value for each channel of the robot at one 60th of a second.
//! - **Torque**: what the motion needs of a channel's actuator at a frame. A library has torques for all clips or none.
//! - **Motion**: a clip with a command code, a node of the graph. The motion clip with number `i` is
//!   node `i`.
//! - **Transition**: a clip that leads from one motion to another, an edge of the graph. Its first
//!   frame *is* the source's exit frame and its last frame *is* the target's entry frame, to the
//!   last bit: leave the source at its exit frame, go on with the transition's frame 1, and after
//!   its last frame go on with the target's frame `entry_frame + 1`.
//! - **Looping** motion of n frames: frame n−1 is followed by frame 0.
//! - **Motion that ends**: stays at its last frame, in which every wheel stands still, and is left
//!   there.
//! - **SAFE**: the motion that every motion has a route to; it comes to rest in the safe pose.
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
pub use block::Unreadable;
pub use container::identity;
pub use cursor::{Advance, ClipCursor};
pub use encode::{encode, encode_with_attitudes};
pub use entry::Entry;
pub use reject::{Reject, Section, Why};
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

/// Frames per second: the only rate of format 1.
pub const RATE_HZ: u16 = 60;
/// Format version: a different major number is refused.
pub const FORMAT_MAJOR: u16 = 1;
/// Format version: a higher minor number has sections and record fields that we skip.
pub const FORMAT_MINOR: u16 = 2;
/// Most motions (nodes) of a library.
pub const MAX_MOTIONS: usize = 32;
/// Most transitions (edges) of a library.
pub const MAX_TRANSITIONS: usize = 96;
/// Most clips of a library: motions, then transitions.
pub const MAX_CLIPS: usize = MAX_MOTIONS + MAX_TRANSITIONS;
/// Longest clip, frames: one minute. Also fits the 12 bits of a status message.
pub const MAX_CLIP_FRAMES: u16 = 3600;
/// Frames from a keyframe, where decoding can start, to the next.
pub const BLOCK_FRAMES: u16 = 60;
/// Longest name of a motion, bytes of UTF-8.
pub const MAX_NAME: usize = 32;

/// Number in tables of transitions for "no route" and "no transition".
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
    /// The motion clip that is played at this node.
    pub fn clip(self) -> ClipId {
        ClipId(self.0)
    }
}
