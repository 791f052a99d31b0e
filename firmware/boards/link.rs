//! The link's packets over a serial port of a real board.

use rollwalk_protocol::serial::{Deframer, Line, Packet};

/// Something that carries bytes both ways.
pub trait Port {
    /// The next byte that was received.
    fn receive(&mut self) -> Option<u8>;

    /// Takes as many bytes as there is room for, and returns how many. None are the end of a packet.
    fn write(&mut self, bytes: &[u8]) -> usize;
}

/// The link over a port.
pub struct Link<P> {
    pub port: P,
    deframer: Deframer,
    line: Line,
    /// Bytes of the line that are with the port.
    sent: usize,
}

impl<P: Port> Link<P> {
    /// The link over a port that nothing was sent over yet.
    pub fn new(port: P) -> Self {
        Self { port, deframer: Deframer::default(), line: Line::new(), sent: 0 }
    }

    /// The next packet that was received.
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

    /// Sends a packet, if [`Self::is_free`].
    pub fn send(&mut self, packet: &Packet<'_>) {
        if let Some(line) = packet.encode() {
            self.line = line;
            self.sent = 0;
        }
    }

    /// Hands bytes to the port while it has room.
    pub fn work(&mut self) {
        let rest = self.line.get(self.sent..).unwrap_or_default();
        self.sent = self.sent.saturating_add(self.port.write(rest));
    }
}
