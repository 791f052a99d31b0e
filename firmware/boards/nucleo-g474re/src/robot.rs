//! The robot that this image is for, as constants made from its file by the build script.

use heapless::Vec;
use rollwalk_protocol::config::{Channel, ChannelKind, RobotConfig};

include!(concat!(env!("OUT_DIR"), "/channels.rs"));

/// The configuration; `None` for a robot with more channels than a controller handles.
pub fn config() -> Option<RobotConfig> {
    Some(RobotConfig { robot: ROBOT, channels: Vec::from_slice(&CHANNELS).ok()? })
}
