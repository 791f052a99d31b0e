//! Packets of the link over a serial port of a real board.

use rollwalk_protocol::serial::{Deframer, Line, Packet};

/// Port that carries bytes in both directions.
pub trait Port {
    /// Returns the next received byte.
    fn receive(&mut self) -> Option<u8>;

    /// Accepts bytes while there is room, and returns their number. An empty slice marks the end of a packet.
    fn write(&mut self, bytes: &[u8]) -> usize;
}

/// Link over a port.
pub struct Link<P> {
    pub port: P,
    deframer: Deframer,
    line: Line,
    /// Number of bytes of the line that the port has accepted.
    sent: usize,
}

impl<P: Port> Link<P> {
    /// Creates a link over a port on which nothing was sent yet.
    pub fn new(port: P) -> Self {
        Self { port, deframer: Deframer::default(), line: Line::new(), sent: 0 }
    }

    /// Returns the next received packet.
    pub fn receive(&mut self) -> Option<Packet<'_>> {
        let zero = loop {
            let byte = self.port.receive()?;
            if byte == 0 {
                break byte;
            }
            self.deframer.push(byte);
        };
        self.deframer.push(zero).and_then(Packet::decode)
    }

    /// True if the previous packet has been sent.
    pub fn is_free(&self) -> bool {
        self.sent >= self.line.len()
    }

    /// Sends a packet. Requires [`Self::is_free`].
    pub fn send(&mut self, packet: &Packet<'_>) {
        if let Some(line) = packet.encode() {
            self.line = line;
            self.sent = 0;
        }
    }

    /// Passes bytes to the port while it has room.
    pub fn work(&mut self) {
        let rest = self.line.get(self.sent..).unwrap_or_default();
        self.sent = self.sent.saturating_add(self.port.write(rest));
    }
}
