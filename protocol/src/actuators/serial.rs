//! Receive buffer, packets and answers that all codecs on serial lines share.

use super::feedback::Feedback;
use heapless::Vec;

/// Longest packet on a serial line, bytes: gains for 24 servos in one sync write, with stuffing.
pub const MAX_PACKET: usize = 256;
/// A packet for a serial line.
pub type Packet = Vec<u8, MAX_PACKET>;

/// Bytes of a line that are no whole message yet.
#[derive(Clone, Debug, Default)]
pub struct ReceiveBuffer {
    bytes: Packet,
    /// Remaining parts of a packet whose parts are answers of different servos.
    pub(super) parts: Option<Parts>,
}

/// Parts of a packet that are still to come.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Parts {
    /// Number of parts.
    pub left: u8,
    /// CRC of all bytes before them.
    pub crc: u16,
}

/// An answer on a serial line.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Answer {
    /// Answer of the actuator at this address.
    Actuator(u8, Feedback),
    /// Answer of an adapter between the line and all actuators on it.
    Adapter(Feedback),
}

impl ReceiveBuffer {
    /// Appends a byte; when there is no room, the oldest makes way.
    pub fn push(&mut self, byte: u8) {
        if self.bytes.push(byte).is_err() {
            self.drop_front(1);
            let _ = self.bytes.push(byte);
        }
    }

    /// The bytes, oldest first.
    pub fn bytes(&self) -> &[u8] {
        &self.bytes
    }

    /// Removes the oldest bytes.
    pub fn drop_front(&mut self, count: usize) {
        let left = self.bytes.len().saturating_sub(count);
        for to in 0..left {
            let byte = self.bytes.get(to.saturating_add(count)).copied().unwrap_or(0);
            if let Some(slot) = self.bytes.get_mut(to) {
                *slot = byte;
            }
        }
        self.bytes.truncate(left);
    }

    /// Removes all bytes.
    pub fn clear(&mut self) {
        *self = Self::default();
    }
}
