//! Sets of channels, a bit each.

pub(crate) use rollwalk_protocol::config::ChannelBits;

use rollwalk_protocol::config::RobotConfig;

pub(crate) fn bit(channel: usize) -> ChannelBits {
    let first: ChannelBits = 1;
    first.checked_shl(channel as u32).unwrap_or(0)
}

pub(crate) fn all(config: &RobotConfig) -> ChannelBits {
    (0..config.channels.len()).fold(0, |bits, channel| bits | bit(channel))
}
