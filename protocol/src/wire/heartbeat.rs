//! Class 1: heartbeats of the host, and clock synchronisation.

use super::{DecodeError, Kind, Node};
use crate::can::Frame;

const HEARTBEAT: Kind = Kind::new(1, 0);
const REPLY: Kind = Kind::new(1, 1);

/// Heartbeat of the host, sent every [`super::HEARTBEAT_PERIOD_MS`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Heartbeat {
    /// Sequence number, which increases by one with each heartbeat, and wraps. A heartbeat that is not ahead of the previous
    /// one is a repeated frame, and does not feed the watchdog.
    pub seq: u8,
    /// Clock of the host, low 32 bits of ms.
    pub host_ms: u32,
}

impl Heartbeat {
    /// Encodes `[crc8][seq u8][host ms u32]`.
    pub fn encode(self, to: Node) -> Frame {
        let [t0, t1, t2, t3] = self.host_ms.to_le_bytes();
        HEARTBEAT.seal(to, [0, self.seq, t0, t1, t2, t3])
    }

    /// Decodes addressee and message.
    pub fn decode(frame: &Frame) -> Result<(Node, Self), DecodeError> {
        let (node, [_, seq, t0, t1, t2, t3]) = HEARTBEAT.unseal(frame)?;
        Ok((node, Self { seq, host_ms: u32::from_le_bytes([t0, t1, t2, t3]) }))
    }
}

/// Answer of the controller to each heartbeat. The host computes the expiry of a [`super::Command`] from the clock in it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct HeartbeatReply {
    /// Sequence number of the heartbeat.
    pub seq: u8,
    /// Clock of the controller when the heartbeat arrived, low 32 bits of ms.
    pub controller_ms: u32,
}

impl HeartbeatReply {
    /// Encodes `[crc8][seq u8][controller ms u32]`.
    pub fn encode(self, from: Node) -> Frame {
        let [t0, t1, t2, t3] = self.controller_ms.to_le_bytes();
        REPLY.seal(from, [0, self.seq, t0, t1, t2, t3])
    }

    /// Decodes sender and message.
    pub fn decode(frame: &Frame) -> Result<(Node, Self), DecodeError> {
        let (node, [_, seq, t0, t1, t2, t3]) = REPLY.unseal(frame)?;
        Ok((node, Self { seq, controller_ms: u32::from_le_bytes([t0, t1, t2, t3]) }))
    }
}
