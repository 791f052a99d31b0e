//! Receive buffer, packets and answers of all codecs on serial lines.

use super::feedback::Feedback;
use heapless::Vec;

/// Maximum number of servos on a serial line, which one packet addresses together.
pub const MAX_ON_LINE: usize = 24;
/// Maximum size of a packet on a serial line, bytes. The longest packet writes gains of all servos, with byte stuffing.
pub const MAX_PACKET: usize = 256;
/// Packet for a serial line.
pub type Packet = Vec<u8, MAX_PACKET>;

/// Received bytes that are not yet a complete message.
#[derive(Clone, Debug, Default)]
pub struct ReceiveBuffer {
    bytes: Packet,
    /// Remaining parts of the current packet, if the parts are answers of different servos.
    pub(super) parts: Option<Parts>,
}

/// Parts of a packet that have not been received yet.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Parts {
    /// Number of parts.
    pub left: u8,
    /// CRC of all bytes of the packet before the missing parts.
    pub crc: u16,
}

/// Answer on a serial line.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Answer {
    /// Answer of the actuator at the given address.
    Actuator(u8, Feedback),
    /// Answer of an adapter between the line and all actuators on it.
    Adapter(Feedback),
}

impl ReceiveBuffer {
    /// Appends a byte. A full buffer drops its oldest byte.
    pub fn push(&mut self, byte: u8) {
        if self.bytes.push(byte).is_err() {
            self.drop_front(1);
            let _ = self.bytes.push(byte);
        }
    }

    /// Buffered bytes, oldest first.
    pub fn bytes(&self) -> &[u8] {
        &self.bytes
    }

    /// Removes the `count` oldest bytes.
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
