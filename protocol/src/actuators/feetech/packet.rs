//! Packets of Feetech's protocol, in the format of Dynamixel Protocol 1.0: header, address, length, instruction or status,
//! parameters, and an 8-bit checksum. Parameters may contain a header.

use crate::actuators::serial::ReceiveBuffer;
use crate::actuators::{MAX_PACKET, Packet};
use crate::packet::append;

/// Broadcast address, of all servos.
pub const BROADCAST: u8 = 0xFE;
/// Largest address.
pub const MAX_ID: u8 = 253;
/// Instruction: read the same addresses from many servos.
pub const SYNC_READ: u8 = 0x82;
/// Instruction: write the same addresses of many servos.
pub const SYNC_WRITE: u8 = 0x83;

/// Number of data bytes of an answer. The controller requests no other number.
pub const ANSWER_BYTES: usize = 8;
/// Length field of an answer: status, data, checksum.
const ANSWER_LENGTH: u8 = ANSWER_BYTES as u8 + 2;
/// Number of bytes up to and including the length field.
const BEFORE: usize = 4;

/// Checksum: complement of the sum of the address and all later bytes.
pub fn checksum(bytes: &[u8]) -> u8 {
    !bytes.iter().fold(0, |sum: u8, byte| sum.wrapping_add(*byte))
}

/// Builds a packet; `None` if it is longer than [`MAX_PACKET`].
pub fn packet(id: u8, instruction: u8, parameters: &[u8]) -> Option<Packet> {
    let mut packet = Packet::new();
    let length = u8::try_from(parameters.len().saturating_add(2)).ok()?;
    append(&mut packet, &[0xFF, 0xFF, id, length, instruction])?;
    append(&mut packet, parameters)?;
    let sum = checksum(packet.get(2..)?);
    packet.push(sum).ok()?;
    Some(packet)
}

/// Answer to a query of [`ANSWER_BYTES`] bytes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Answer {
    /// Address of the servo.
    pub id: u8,
    /// Error bits of the servo.
    pub status: u8,
    /// Data read.
    pub data: [u8; ANSWER_BYTES],
}

/// Removes the next answer from the bytes of a line, and all bytes before it.
///
/// The controller's own packets come back on a half-duplex line, with the broadcast address; they are dropped. A header followed
/// by an impossible length is rejected, since an 8-bit checksum alone would sometimes accept it. An incomplete packet stays in
/// the buffer. If the line `is_silent`, its rest is lost, and it is dropped.
pub fn take(buffer: &mut ReceiveBuffer, is_silent: bool) -> Option<Answer> {
    // Every iteration removes bytes.
    while !buffer.bytes().is_empty() {
        let length = match *buffer.bytes() {
            [0xFF, 0xFF, BROADCAST, length, ..] if length > 2 => length,
            [0xFF, 0xFF, id, ANSWER_LENGTH, ..] if id <= MAX_ID => ANSWER_LENGTH,
            [0xFF] | [0xFF, 0xFF] | [0xFF, 0xFF, ..=BROADCAST] if !is_silent => return None,
            _ => {
                buffer.drop_front(1);
                continue;
            }
        };
        let whole = BEFORE.saturating_add(length.into());
        match buffer.bytes().get(..whole) {
            Some([_, _, body @ .., sum]) if checksum(body) == *sum => {
                let answer = match body {
                    [id @ ..=MAX_ID, _, status, data @ ..] => {
                        data.try_into().ok().map(|data| Answer { id: *id, status: *status, data })
                    }
                    _ => None,
                };
                buffer.drop_front(whole);
                if answer.is_some() {
                    return answer;
                }
            }
            None if !is_silent && whole <= MAX_PACKET => return None,
            _ => buffer.drop_front(1),
        }
    }
    None
}
