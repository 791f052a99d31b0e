//! Packets of Dynamixel Protocol 2.0: header, address, length, instruction, parameters, CRC-16. Byte stuffing keeps headers out
//! of the parameters.

use crc::{CRC_16_UMTS, Crc};
use heapless::Vec;

use crate::actuators::serial::{Parts, ReceiveBuffer};
use crate::actuators::{MAX_PACKET, Packet};
use crate::packet::append;

static CRC_16: Crc<u16> = Crc::<u16>::new(&CRC_16_UMTS);

/// Header of every packet.
pub const HEADER: [u8; 4] = [0xFF, 0xFF, 0xFD, 0x00];
/// Broadcast address. Servos answer only a ping and a sync read that are sent to it.
pub const BROADCAST: u8 = 0xFE;
/// Largest address.
pub const MAX_ID: u8 = 252;
/// Number of bytes before the instruction.
pub(super) const BEFORE: usize = 7;
/// Maximum number of parameters of a received packet: all bytes but header, address, length, instruction and CRC.
const MAX_PARAMETERS: usize = MAX_PACKET - BEFORE - 3;

/// Instruction: read from one servo.
pub const READ: u8 = 0x02;
/// Instruction: write to one servo.
pub const WRITE: u8 = 0x03;
/// Instruction: reboot a servo. Nothing else clears a hardware error.
pub const REBOOT: u8 = 0x08;
/// Instruction code of an answer.
pub const STATUS: u8 = 0x55;
/// Instruction: read the same addresses from many servos.
pub const SYNC_READ: u8 = 0x82;
/// Instruction: read the same addresses from many servos, which answer together in one packet.
pub const FAST_SYNC_READ: u8 = 0x8A;
/// Instruction: write the same addresses of many servos.
pub const SYNC_WRITE: u8 = 0x83;

/// Packet with a valid CRC, without byte stuffing.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Message {
    /// Address of the servo that receives the instruction or sends the answer.
    pub id: u8,
    /// Instruction code; [`STATUS`] for an answer.
    pub instruction: u8,
    /// Parameters; in an answer, the error byte comes first.
    pub parameters: Vec<u8, MAX_PARAMETERS>,
}

/// CRC-16 of Protocol 2.0: polynomial 0x8005, initial value 0, not reflected.
pub fn crc16(bytes: &[u8]) -> u16 {
    CRC_16.checksum(bytes)
}

/// Builds a packet; `None` if it is longer than [`MAX_PACKET`], or if `id` is not an address.
pub fn packet(id: u8, instruction: u8, parameters: &[u8]) -> Option<Packet> {
    if id > MAX_ID && id != BROADCAST {
        return None;
    }
    let mut packet = Packet::new();
    append(&mut packet, &HEADER)?;
    append(&mut packet, &[id, 0, 0, instruction])?;
    let (mut before_last, mut last) = (0, instruction);
    for &byte in parameters {
        packet.push(byte).ok()?;
        if (before_last, last, byte) == (0xFF, 0xFF, 0xFD) {
            packet.push(0xFD).ok()?;
        }
        (before_last, last) = (last, byte);
    }
    let length = packet.len().saturating_sub(BEFORE).saturating_add(2) as u16;
    let [_, _, _, _, _, low, high, ..] = packet.as_mut_slice() else { return None };
    [*low, *high] = length.to_le_bytes();
    let crc = crc16(&packet);
    append(&mut packet, &crc.to_le_bytes())?;
    Some(packet)
}

/// Removes the next packet from the bytes of a line.
///
/// Bytes before a header are discarded. If the packet after a header is invalid, only its first byte is discarded, and the search
/// continues behind it. An incomplete packet stays in the buffer. If the line `is_silent`, an incomplete packet counts as
/// invalid, since its rest is lost.
pub fn take(buffer: &mut ReceiveBuffer, is_silent: bool) -> Option<Message> {
    match next(buffer, is_silent, false)? {
        ReceivedPacket::Message(message) => Some(message),
        ReceivedPacket::Part(_) => None,
    }
}

/// Packet or part of one that [`next`] removed from the buffer.
#[expect(
    clippy::large_enum_variant,
    reason = "there are no boxes without alloc, and it is not kept"
)]
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum ReceivedPacket {
    /// A packet.
    Message(Message),
    /// Part of an answer to [`FAST_SYNC_READ`], from one servo.
    Part(Part),
}

/// Removes the next packet, as [`take`] does. Set `with_parts` while answers to [`FAST_SYNC_READ`] are expected: their parts
/// are then returned one by one.
pub fn next(
    buffer: &mut ReceiveBuffer,
    is_silent: bool,
    with_parts: bool,
) -> Option<ReceivedPacket> {
    if is_silent && buffer.bytes().is_empty() {
        buffer.parts = None;
    }
    // Every iteration removes bytes, or ends a packet of parts whose beginning was removed before.
    while !buffer.bytes().is_empty() {
        if buffer.parts.is_none() {
            buffer.drop_front(header_at(buffer.bytes()));
        }
        if with_parts {
            if buffer.parts.is_none()
                && let Some(parts) = parts_at(buffer.bytes())
            {
                buffer.drop_front(BEFORE_PARTS);
                buffer.parts = Some(parts);
            }
            if buffer.parts.is_some() {
                if let Some(part) = take_part(buffer) {
                    return Some(ReceivedPacket::Part(part));
                }
                if buffer.parts.is_some() && !is_silent {
                    return None;
                }
                // The bytes begin in the middle of a packet.
                buffer.parts = None;
                continue;
            }
        }
        let whole = match *buffer.bytes() {
            [_, _, _, _, _, low, high, ..] => usize::from(u16::from_le_bytes([low, high])) + BEFORE,
            _ if is_silent => MAX_PACKET,
            _ => return None,
        };
        // Instruction and CRC at least.
        if (BEFORE + 3..=MAX_PACKET).contains(&whole) {
            match buffer.bytes().get(..whole) {
                Some(packet) => {
                    if let Some(message) = message(packet) {
                        buffer.drop_front(whole);
                        return Some(ReceivedPacket::Message(message));
                    }
                }
                None if is_silent => {}
                None => return None,
            }
        }
        buffer.drop_front(1);
    }
    None
}

/// Number of data bytes of a part of an answer to [`FAST_SYNC_READ`]. The controller requests no other number.
pub const PART_BYTES: usize = 10;
/// Length of a part, bytes: error, address, data, CRC.
const PART: usize = PART_BYTES + 4;
/// Number of bytes before the first part.
const BEFORE_PARTS: usize = BEFORE + 1;
/// Maximum number of servos that can answer in one packet, which must fit in a buffer.
pub const MAX_PARTS: usize = (MAX_PACKET - BEFORE_PARTS) / PART;

/// Part of an answer to [`FAST_SYNC_READ`], from one servo and with a valid CRC.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Part {
    /// Address of the servo.
    pub id: u8,
    /// Error byte of the servo.
    pub error: u8,
    /// Data read.
    pub data: [u8; PART_BYTES],
}

/// Parts of an answer to [`FAST_SYNC_READ`]; `None` if `bytes` do not begin with such an answer.
fn parts_at(bytes: &[u8]) -> Option<Parts> {
    let [_, _, _, _, BROADCAST, low, high, STATUS, ..] = *bytes else { return None };
    let left = usize::from(u16::from_le_bytes([low, high])).checked_sub(1)?;
    let parts = left / PART;
    if !left.is_multiple_of(PART) || parts == 0 || parts > MAX_PARTS {
        return None;
    }
    Some(Parts { left: parts as u8, crc: crc16(bytes.get(..BEFORE_PARTS)?) })
}

/// Removes the next part of an answer to [`FAST_SYNC_READ`] as soon as it is complete.
///
/// If a servo is silent, its own part and the later ones are lost, but no earlier one. These packets have no stuffing, and the
/// CRC of a part covers all bytes before it. Returns `None` while the part is incomplete, and if its CRC is wrong, which ends
/// the parts.
fn take_part(buffer: &mut ReceiveBuffer) -> Option<Part> {
    let Parts { left, crc } = buffer.parts?;
    let (body, sum) = buffer.bytes().get(..PART)?.split_last_chunk()?;
    let [error, id, data @ ..] = body else { return None };
    let part = data.try_into().ok().map(|data| Part { id: *id, error: *error, data });
    let after = |crc, bytes| {
        let mut digest = CRC_16.digest_with_initial(crc);
        digest.update(bytes);
        digest.finalize()
    };
    let of_body = after(crc, body);
    let is_whole = of_body == u16::from_le_bytes(*sum);
    let more = left.checked_sub(1).filter(|left| *left > 0 && is_whole);
    buffer.parts = more.map(|left| Parts { left, crc: after(of_body, sum) });
    if is_whole {
        buffer.drop_front(PART);
    }
    part.filter(|_| is_whole)
}

/// Index of the first header, complete or cut off by the end of the bytes; `bytes.len()` if there is no header.
fn header_at(bytes: &[u8]) -> usize {
    let begins = |&at: &usize| bytes.iter().skip(at).zip(HEADER).all(|(&a, b)| a == b);
    (0..bytes.len()).find(begins).unwrap_or(bytes.len())
}

/// Decodes a whole packet; `None` if its CRC is wrong.
fn message(packet: &[u8]) -> Option<Message> {
    let (body, crc) = packet.split_last_chunk()?;
    let [_, _, _, _, id, _, _, instruction, stuffed @ ..] = body else { return None };
    if crc16(body) != u16::from_le_bytes(*crc) {
        return None;
    }
    let mut message = Message { id: *id, instruction: *instruction, parameters: Vec::new() };
    let (mut before_last, mut last) = (0, *instruction);
    let mut bytes = stuffed.iter().copied();
    while let Some(byte) = bytes.next() {
        message.parameters.push(byte).ok()?;
        if (before_last, last, byte) == (0xFF, 0xFF, 0xFD) {
            // Stuffing. Protocol 2.0 writes no other byte here.
            if bytes.next() != Some(0xFD) {
                return None;
            }
        }
        (before_last, last) = (last, byte);
    }
    Some(message)
}

/// Answer of a servo.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Status<'a> {
    /// Address of the servo.
    pub id: u8,
    /// True if the hardware has an error; [`HARDWARE_ERROR`](super::table::HARDWARE_ERROR) contains the cause.
    pub alert: bool,
    /// Error code: 0 none, 1 failed, 2 unknown instruction, 3 CRC, 4 out of range, 5 too short, 6 beyond a limit, 7 no access.
    pub error: u8,
    /// Data read.
    pub data: &'a [u8],
}

impl Message {
    /// Interprets the message as an answer. `None` for instructions, such as the controller's own on a line with echo.
    pub fn status(&self) -> Option<Status<'_>> {
        let (&error, data) = self.parameters.split_first()?;
        let status = Status { id: self.id, alert: error & 0x80 != 0, error: error & 0x7F, data };
        (self.instruction == STATUS).then_some(status)
    }
}
