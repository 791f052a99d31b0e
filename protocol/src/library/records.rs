//! Records of the tables, in postcard with fixed-width little-endian integers. A table has a constant stride, so that record i
//! is found without reading those before it.
//!
//! A later minor version may append fields; the stride in the section's header skips them.

use super::container::u16_at;
use serde::{Deserialize, Serialize};

/// Counts of a library, and the hash of the robot's configuration.
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
    /// Kind of the channel: 0 joint position, 1 wheel speed.
    pub kind: u8,
    /// Exponent of the quantum `2^lsb_exponent`, in rad, or in rad/s for a wheel.
    pub lsb_exponent: i8,
    #[serde(with = "postcard::fixint::le")]
    pub min: i16,
    #[serde(with = "postcard::fixint::le")]
    pub max: i16,
    /// Largest change from one frame to the next, quanta.
    #[serde(with = "postcard::fixint::le")]
    pub max_step: u16,
}

/// Length and position of a clip's frames.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct ClipRecord {
    /// Flags: [`FLAG_LOOPING`]; the other bits are 0.
    pub flags: u8,
    #[serde(with = "postcard::fixint::le")]
    pub frames: u16,
    /// Offset of the first block in the frames section, bytes.
    #[serde(with = "postcard::fixint::le")]
    pub offset: u32,
    /// Length of all blocks of the clip, bytes.
    #[serde(with = "postcard::fixint::le")]
    pub len: u32,
}

/// Position of a clip's torques in their section, with offset and length as in [`ClipRecord`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub(crate) struct TorqueClipRecord {
    #[serde(with = "postcard::fixint::le")]
    pub offset: u32,
    #[serde(with = "postcard::fixint::le")]
    pub len: u32,
}

/// Direction of up during a clip. Since format 1.1, this record follows the [`ClipRecord`] if the builder provides it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub(crate) struct AttitudeRecord {
    /// Direction in the body frame, in units of 2⁻¹⁴.
    #[serde(with = "postcard::fixint::le")]
    pub up_x: i16,
    #[serde(with = "postcard::fixint::le")]
    pub up_y: i16,
    #[serde(with = "postcard::fixint::le")]
    pub up_z: i16,
    /// Largest angle between this direction and the vertical during the clip, mrad.
    #[serde(with = "postcard::fixint::le")]
    pub spread: u16,
}

impl AttitudeRecord {
    /// Reads the record at the start of `bytes`. Written by hand for speed: it runs in every control period with an IMU.
    pub fn read(bytes: &[u8]) -> Option<Self> {
        let signed = |at| u16_at(bytes, at).map(|bits| bits as i16);
        let (up_x, up_y, up_z) = (signed(0)?, signed(2)?, signed(4)?);
        Some(Self { up_x, up_y, up_z, spread: u16_at(bytes, 6)? })
    }
}

/// Flag of a looping clip, in which frame 0 follows the last frame.
pub(crate) const FLAG_LOOPING: u8 = 1;

/// Edge of the graph. Its clip is the transition with the same number.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct EdgeRecord {
    pub from: u8,
    pub to: u8,
    #[serde(with = "postcard::fixint::le")]
    pub exit_frame: u16,
    #[serde(with = "postcard::fixint::le")]
    pub entry_frame: u16,
}

/// Command code and the node that it selects.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct CodeRecord {
    pub code: u8,
    pub node: u8,
}

/// Size of a manifest as this version writes it, bytes.
pub(crate) const MANIFEST_LEN: u16 = 10;
/// Size of a channel's record as this version writes it, bytes.
pub(crate) const CHANNEL_LEN: u16 = 8;
/// Size of a clip's record as this version writes it, bytes.
pub(crate) const CLIP_LEN: u16 = 11;
/// Size of an attitude's record as this version writes it, bytes.
pub(crate) const ATTITUDE_LEN: u16 = 8;
/// Size of an edge's record as this version writes it, bytes.
pub(crate) const EDGE_LEN: u16 = 6;
/// Size of a code's record as this version writes it, bytes.
pub(crate) const CODE_LEN: u16 = 2;
/// Size of a record of torques as this version writes it, bytes.
pub(crate) const TORQUE_CLIP_LEN: u16 = 8;
