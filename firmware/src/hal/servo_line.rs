//! Half-duplex line of serial servos, which feeds packets to the transmitter byte by byte, and removes their echo from the
//! received bytes.
//!
//! While the line [is free](ServoLine::is_free), the board sends the packets of [`crate::Controller::poll_serial`]. It passes
//! the bytes of [`ServoLine::next_byte`] to its transmitter. It passes received bytes through [`ServoLine::receive`] to
//! [`crate::Controller::on_serial`].
//!
//! The transmitter must release the wire in hardware after the final bit. A servo answers within microseconds, when the control
//! loop may be busy.

use rollwalk_protocol::actuators::Packet;

/// Transmission in progress on a line.
#[derive(Clone, Debug, Default)]
pub struct ServoLine {
    packet: Packet,
    /// Number of bytes of the packet passed to the transmitter.
    sent: usize,
    /// Number of bytes of the packet received as echo.
    heard: usize,
}

impl ServoLine {
    /// True if all bytes of the previous packet were passed to the transmitter.
    pub fn is_free(&self) -> bool {
        self.sent >= self.packet.len()
    }

    /// Sends a packet. Requires [`Self::is_free`].
    pub fn send(&mut self, packet: Packet) {
        *self = Self { packet, sent: 0, heard: 0 };
    }

    /// Returns the next byte for the transmitter, which must have room for it.
    pub fn next_byte(&mut self) -> Option<u8> {
        let byte = self.packet.get(self.sent).copied()?;
        self.sent = self.sent.saturating_add(1);
        Some(byte)
    }

    /// Accepts a byte from the wire; returns `None` if it is the echo of a sent byte.
    ///
    /// A byte that differs from the sent one has collided with a servo's byte: the rest of the echo is no longer expected.
    pub fn receive(&mut self, byte: u8) -> Option<u8> {
        if self.heard < self.sent {
            let own = self.packet.get(self.heard) == Some(&byte);
            self.heard = if own { self.heard.saturating_add(1) } else { self.packet.len() };
            if own {
                return None;
            }
        }
        Some(byte)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn packet(bytes: &[u8]) -> Packet {
        Packet::from_slice(bytes).unwrap()
    }

    /// Sends a packet on a wire with echo, followed by the servos' answer. Returns the bytes that remain after the echo is
    /// removed.
    fn exchange(line: &mut ServoLine, bytes: &[u8], answer: &[u8]) -> Packet {
        assert!(line.is_free());
        line.send(packet(bytes));
        let mut heard = Packet::new();
        let mut on_wire = Packet::new();
        while let Some(byte) = line.next_byte() {
            on_wire.push(byte).unwrap();
            // The echo arrives while more bytes are sent.
            heard.extend(line.receive(byte));
        }
        assert_eq!(on_wire, bytes);
        answer.iter().for_each(|&byte| heard.extend(line.receive(byte)));
        heard
    }

    #[test]
    fn the_echo_is_dropped_and_the_answer_is_not() {
        let mut line = ServoLine::default();
        // The answer begins with the same bytes as the request.
        assert_eq!(
            exchange(&mut line, &[0xFF, 0xFF, 1, 2], &[0xFF, 0xFF, 1, 9]),
            [0xFF, 0xFF, 1, 9]
        );
        assert_eq!(exchange(&mut line, &[7], &[]), []);
        assert_eq!(line.receive(3), Some(3), "with nothing sent, everything is a servo's");
    }

    #[test]
    fn a_collision_ends_the_echo() {
        let mut line = ServoLine::default();
        line.send(packet(&[1, 2, 3]));
        (0..3).for_each(|_| assert!(line.next_byte().is_some()));
        assert_eq!((line.receive(1), line.receive(0x80)), (None, Some(0x80)));
        assert_eq!((line.receive(3), line.receive(5)), (Some(3), Some(5)));
        assert!(line.is_free() && line.next_byte().is_none());
    }

    #[test]
    fn an_echo_that_was_lost_does_not_cost_the_next_answer() {
        let mut line = ServoLine::default();
        line.send(packet(&[1, 2, 3]));
        (0..3).for_each(|_| assert!(line.next_byte().is_some()));
        assert_eq!(exchange(&mut line, &[4, 5], &[6]), [6]);
    }
}
