//! Line of serial servos on the hardware of a board.

use heapless::spsc::Consumer;
use rollwalk_firmware::hal::servo_line::ServoLine;
use rollwalk_protocol::actuators::Packet;

/// Hardware that sends bytes to servos.
pub trait Transmitter {
    /// True if there is room for a byte.
    fn has_room(&self) -> bool;

    /// Sends a byte. Requires [`Self::has_room`].
    fn write(&mut self, byte: u8);
}

pub struct Line<T> {
    transmitter: T,
    state: ServoLine,
    received: Consumer<'static, u8>,
}

impl<T: Transmitter> Line<T> {
    /// Creates a line over which nothing was sent yet.
    pub fn new(transmitter: T, received: Consumer<'static, u8>) -> Self {
        Self { transmitter, state: ServoLine::default(), received }
    }

    /// Returns the next byte of a servo.
    pub fn receive(&mut self) -> Option<u8> {
        loop {
            let byte = self.received.dequeue()?;
            if let Some(byte) = self.state.receive(byte) {
                return Some(byte);
            }
        }
    }

    /// True if the hardware has accepted all bytes of the previous packet.
    pub fn is_free(&self) -> bool {
        self.state.is_free()
    }

    /// Sends a packet. Requires [`Self::is_free`].
    pub fn send(&mut self, packet: Packet) {
        self.state.send(packet);
    }

    /// Passes bytes to the hardware while it has room.
    pub fn work(&mut self) {
        while self.transmitter.has_room()
            && let Some(byte) = self.state.next_byte()
        {
            self.transmitter.write(byte);
        }
    }
}
