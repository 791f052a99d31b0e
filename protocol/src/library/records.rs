//! Records of the tables: postcard with fixed-width little-endian integers, so that a table has a
//! constant stride and record i is found without reading those before it.
//!
//! A later minor version may append fields; the stride in the section's header skips them.

use super::container::u16_at;
use serde::{Deserialize, Serialize};

/// Counts of a library, and the robot that it is for.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct Manifest {
    #[serde(with = "postcard::fixint::le")]
    pub config_hash: u32,
    #[serde(with = "postcard::fixint::le")]
    pub rate_hz: u16,
    pub channels: u8,
    pub motions: u8,
    pub transitions: u8,
    pub safe_node: u8,
}

/// Quantum of a channel, and its limits in quanta.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct ChannelRecord {
    /// 0 joint position, 1 wheel speed.
    pub kind: u8,
    /// A quantum is 2 to this power: rad, or rad/s for a wheel.
    pub lsb_exponent: i8,
    #[serde(with = "postcard::fixint::le")]
    pub min: i16,
    #[serde(with = "postcard::fixint::le")]
    pub max: i16,
    /// Largest change from a frame to the next.
    #[serde(with = "postcard::fixint::le")]
    pub max_step: u16,
}

/// Length and position of a clip's frames.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct ClipRecord {
    /// [`FLAG_LOOPING`]; the other bits are 0.
    pub flags: u8,
    #[serde(with = "postcard::fixint::le")]
    pub frames: u16,
    /// First block, bytes from the start of the frames section.
    #[serde(with = "postcard::fixint::le")]
    pub offset: u32,
    /// Bytes of all its blocks.
    #[serde(with = "postcard::fixint::le")]
    pub len: u32,
}

/// Position of a clip's torques, like the frames in its [`ClipRecord`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub(crate) struct TorqueClipRecord {
    #[serde(with = "postcard::fixint::le")]
    pub offset: u32,
    #[serde(with = "postcard::fixint::le")]
    pub len: u32,
}

/// Direction of up during a clip; follows the [`ClipRecord`] where the builder has given it, since
/// format 1.1.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub(crate) struct AttitudeRecord {
    /// Direction in the body frame, in parts of 2 to the power of −14.
    #[serde(with = "postcard::fixint::le")]
    pub up_x: i16,
    #[serde(with = "postcard::fixint::le")]
    pub up_y: i16,
    #[serde(with = "postcard::fixint::le")]
    pub up_z: i16,
    /// Furthest from there, mrad.
    #[serde(with = "postcard::fixint::le")]
    pub spread: u16,
}

impl AttitudeRecord {
    /// The record at the start of some bytes. By hand: in every control period with an IMU.
    pub fn read(bytes: &[u8]) -> Option<Self> {
        let signed = |at| u16_at(bytes, at).map(|bits| bits as i16);
        let (up_x, up_y, up_z) = (signed(0)?, signed(2)?, signed(4)?);
        Some(Self { up_x, up_y, up_z, spread: u16_at(bytes, 6)? })
    }
}

/// After the last frame comes frame 0.
pub(crate) const FLAG_LOOPING: u8 = 1;

/// An edge of the graph; its clip is the transition with the same number.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct EdgeRecord {
    pub from: u8,
    pub to: u8,
    #[serde(with = "postcard::fixint::le")]
    pub exit_frame: u16,
    #[serde(with = "postcard::fixint::le")]
    pub entry_frame: u16,
}

/// A command code and the node that it asks for.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct CodeRecord {
    pub code: u8,
    pub node: u8,
}

/// Bytes of each record as this version writes it.
pub(crate) const MANIFEST_LEN: u16 = 10;
pub(crate) const CHANNEL_LEN: u16 = 8;
pub(crate) const CLIP_LEN: u16 = 11;
pub(crate) const ATTITUDE_LEN: u16 = 8;
pub(crate) const EDGE_LEN: u16 = 6;
pub(crate) const CODE_LEN: u16 = 2;
pub(crate) const TORQUE_CLIP_LEN: u16 = 8;
