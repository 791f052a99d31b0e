//! Sets of channels, a bit each.

use rollwalk_protocol::config::{MAX_CHANNELS, RobotConfig};

/// Bit of a channel.
pub(crate) fn bit(channel: usize) -> u32 {
    const { assert!(MAX_CHANNELS <= 32, "a bit for each channel") };
    1_u32.checked_shl(channel as u32).unwrap_or(0)
}

/// Bits of all channels of a robot.
pub(crate) fn all(config: &RobotConfig) -> u32 {
    (0..config.channels.len()).fold(0, |bits, channel| bits | bit(channel))
}
