//! Packets of Feetech's protocol, which are those of Dynamixel Protocol 1.0: header, address, length, instruction or
//! status, parameters, a sum of 8 bits. Nothing keeps headers out of parameters.

use crate::actuators::serial::ReceiveBuffer;
use crate::actuators::{MAX_PACKET, Packet};
use crate::packet::append;

/// Address of all servos.
pub const BROADCAST: u8 = 0xFE;
/// Largest address.
pub const MAX_ID: u8 = 253;
/// Instruction: read the same addresses from many servos.
pub const SYNC_READ: u8 = 0x82;
/// Instruction: write the same addresses of many servos.
pub const SYNC_WRITE: u8 = 0x83;

/// Data of the only answers that we ask for.
pub const ANSWER_BYTES: usize = 8;
/// The length that they give: status, data, sum.
const ANSWER_LENGTH: u8 = ANSWER_BYTES as u8 + 2;
/// Bytes up to the length.
const BEFORE: usize = 4;

/// The complement of the sum of all bytes from the address on.
pub fn checksum(bytes: &[u8]) -> u8 {
    !bytes.iter().fold(0, |sum: u8, byte| sum.wrapping_add(*byte))
}

/// A packet; `None` when it gets longer than [`MAX_PACKET`].
pub fn packet(id: u8, instruction: u8, parameters: &[u8]) -> Option<Packet> {
    let mut packet = Packet::new();
    let length = u8::try_from(parameters.len().saturating_add(2)).ok()?;
    append(&mut packet, &[0xFF, 0xFF, id, length, instruction])?;
    append(&mut packet, parameters)?;
    let sum = checksum(packet.get(2..)?);
    packet.push(sum).ok()?;
    Some(packet)
}

/// An answer to a question for [`ANSWER_BYTES`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Answer {
    /// Address of the servo.
    pub id: u8,
    /// Error bits of the servo.
    pub status: u8,
    /// Data read.
    pub data: [u8; ANSWER_BYTES],
}

/// Removes the next answer from the bytes of a line, and whatever comes before it. Our own packets come back on a
/// half-duplex line; they are for all servos. Lengths of neither are no headers, which such a short sum would let
/// through now and then. A packet that is there in part is waited for, unless the line `is_silent`: then it is not going
/// to end.
pub fn take(buffer: &mut ReceiveBuffer, is_silent: bool) -> Option<Answer> {
    // Every turn takes bytes away.
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
