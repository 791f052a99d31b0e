//! A line of serial servos over a board's hardware.

use heapless::spsc::Consumer;
use rollwalk_firmware::hal::servo_line::ServoLine;
use rollwalk_protocol::actuators::Packet;

/// Hardware that sends bytes to servos.
pub trait Transmitter {
    /// True if there is room for a byte.
    fn has_room(&self) -> bool;

    /// Takes a byte, if [`Self::has_room`].
    fn write(&mut self, byte: u8);
}

pub struct Line<T> {
    transmitter: T,
    state: ServoLine,
    received: Consumer<'static, u8>,
}

impl<T: Transmitter> Line<T> {
    /// A line that nothing was sent over yet.
    pub fn new(transmitter: T, received: Consumer<'static, u8>) -> Self {
        Self { transmitter, state: ServoLine::default(), received }
    }

    /// The next byte of a servo.
    pub fn receive(&mut self) -> Option<u8> {
        loop {
            let byte = self.received.dequeue()?;
            if let Some(byte) = self.state.receive(byte) {
                return Some(byte);
            }
        }
    }

    /// True if the hardware has all of the previous packet.
    pub fn is_free(&self) -> bool {
        self.state.is_free()
    }

    /// Sends a packet, if [`Self::is_free`].
    pub fn send(&mut self, packet: Packet) {
        self.state.send(packet);
    }

    /// Hands bytes to the hardware while it has room.
    pub fn work(&mut self) {
        while self.transmitter.has_room()
            && let Some(byte) = self.state.next_byte()
        {
            self.transmitter.write(byte);
        }
    }
}
