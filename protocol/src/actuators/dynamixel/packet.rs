//! Packets of Dynamixel Protocol 2.0: header, address, length, instruction, parameters, CRC-16, with
//! the byte stuffing that keeps headers out of parameters.

use crc::{CRC_16_UMTS, Crc};
use heapless::Vec;

use crate::actuators::serial::ReceiveBuffer;
use crate::actuators::{MAX_PACKET, Packet};
use crate::packet::append;

static CRC_16: Crc<u16> = Crc::<u16>::new(&CRC_16_UMTS);

/// How every packet begins.
pub const HEADER: [u8; 4] = [0xFF, 0xFF, 0xFD, 0x00];
/// Address of all servos: no answers, but to a ping and to a sync read.
pub const BROADCAST: u8 = 0xFE;
/// Largest address.
pub const MAX_ID: u8 = 252;
/// Bytes before the instruction.
pub(super) const BEFORE: usize = 7;
/// Most parameters of a packet that comes in: all but header, address, length, instruction, CRC.
const MAX_PARAMETERS: usize = MAX_PACKET - BEFORE - 3;

/// Instruction: read from one servo.
pub const READ: u8 = 0x02;
/// Instruction: write to one servo.
pub const WRITE: u8 = 0x03;
/// Instruction: restart a servo, the only way out of a hardware error.
pub const REBOOT: u8 = 0x08;
/// Instruction of answers.
pub const STATUS: u8 = 0x55;
/// Instruction: read the same addresses from many servos.
pub const SYNC_READ: u8 = 0x82;
/// Instruction: write the same addresses of many servos.
pub const SYNC_WRITE: u8 = 0x83;

/// A packet whose CRC was right, without its stuffing.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Message {
    /// Of the servo that is spoken to, or speaks.
    pub id: u8,
    /// What it is.
    pub instruction: u8,
    /// Its parameters; of an answer, the error byte first.
    pub parameters: Vec<u8, MAX_PARAMETERS>,
}

/// CRC-16 of Protocol 2.0: polynomial 0x8005, initial value 0, not reflected.
pub fn crc16(bytes: &[u8]) -> u16 {
    CRC_16.checksum(bytes)
}

/// A packet; `None` when it gets longer than [`MAX_PACKET`], or `id` is no address.
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

/// Removes the next packet from the bytes of a line. Whatever came before, it takes up again at the next
/// header: bytes that were mistaken for a packet are searched again. A packet that is there in part
/// is waited for, unless the line `is_silent`: then it is not going to end.
pub fn take(buffer: &mut ReceiveBuffer, is_silent: bool) -> Option<Message> {
    // Every turn takes bytes away.
    while !buffer.bytes().is_empty() {
        buffer.drop_front(header_at(buffer.bytes()));
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
                        return Some(message);
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

/// Index of the first header, complete or cut off by the end of the bytes; their count without one.
fn header_at(bytes: &[u8]) -> usize {
    let begins = |&at: &usize| bytes.iter().skip(at).zip(HEADER).all(|(&a, b)| a == b);
    (0..bytes.len()).find(begins).unwrap_or(bytes.len())
}

/// What a whole packet says, if its CRC is right.
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
            // The stuffing. Anything else there was not put there by Protocol 2.0.
            if bytes.next() != Some(0xFD) {
                return None;
            }
        }
        (before_last, last) = (last, byte);
    }
    Some(message)
}

/// An answer of a servo.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Status<'a> {
    /// Whose.
    pub id: u8,
    /// Something is wrong with the hardware: [`HARDWARE_ERROR`](super::table::HARDWARE_ERROR) has
    /// what.
    pub alert: bool,
    /// Why the instruction was not carried out: 1 failed, 2 unknown, 3 CRC, 4 out of range, 5 too
    /// short, 6 beyond a limit, 7 no access. 0 it was.
    pub error: u8,
    /// What was read.
    pub data: &'a [u8],
}

impl Message {
    /// The answer that this is; `None` for instructions, among them our own on a line that hears
    /// itself.
    pub fn status(&self) -> Option<Status<'_>> {
        let (&error, data) = self.parameters.split_first()?;
        let status = Status { id: self.id, alert: error & 0x80 != 0, error: error & 0x7F, data };
        (self.instruction == STATUS).then_some(status)
    }
}
