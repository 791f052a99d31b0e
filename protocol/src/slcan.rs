//! SLCAN, Lawicel's protocol: CAN frames as lines of text, for cheap adapters and Linux's `slcand`.
//!
//! Source: Lawicel AB, "CANUSB manual" (command set of the CAN232). A line ends with a carriage return. `t1232AABB` is a frame
//! with the 11-bit identifier 123 and two bytes of data. `T` begins a frame with a 29-bit identifier. An adapter answers with a
//! single carriage return for OK, or with a bell for an error.

use crate::can::{Frame, Id};
use heapless::Vec;

/// Last byte of a line; alone it means OK.
const END: u8 = b'\r';
const BELL: u8 = 7;
/// Maximum length of a line with its end, bytes: `T`, eight digits, length, sixteen digits.
const MAX_LINE: usize = 27;

/// Line for an adapter or a host, with its end.
pub type Line = Vec<u8, MAX_LINE>;

/// Message of a host or an adapter.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Message {
    /// Frame that a host sends or an adapter has received.
    Frame(Frame),
    /// Host: set the bitrate of the bus, by Lawicel's digit 0 to 8 (10, 20, 50, 100, 125, 250, 500, 800, 1000 kbit/s).
    Bitrate(u8),
    /// Host: connect to the bus.
    Open,
    /// Host: disconnect from the bus.
    Close,
    /// Adapter: the command was executed, or the frame was sent.
    Ok,
    /// Adapter: the command was refused.
    Error,
    /// Other command, by its letter.
    Other(u8),
}

/// Lawicel's digit for a bitrate, bit/s; `None` if there is no digit for it.
pub fn bitrate_digit(bitrate: u32) -> Option<u8> {
    let known = [10, 20, 50, 100, 125, 250, 500, 800, 1000];
    (0..).zip(known).find(|&(_, kbit)| kbit * 1000 == bitrate).map(|(digit, _)| digit)
}

impl Message {
    /// Encodes the message as a line; `None` for [`Message::Other`] and for an invalid digit.
    pub fn encode(&self) -> Option<Line> {
        let mut line = Line::new();
        match self {
            Self::Frame(frame) => {
                match frame.id() {
                    Id::Standard(id) => {
                        line.push(b't').ok()?;
                        digits(&mut line, u32::from(id.as_raw()), 3)?;
                    }
                    Id::Extended(id) => {
                        line.push(b'T').ok()?;
                        digits(&mut line, id.as_raw(), 8)?;
                    }
                }
                digits(&mut line, frame.data().len() as u32, 1)?;
                frame.data().iter().try_for_each(|&byte| digits(&mut line, byte.into(), 2))?;
            }
            Self::Bitrate(digit) => {
                line.push(b'S').ok()?;
                line.push((*digit <= 8).then(|| b'0' + *digit)?).ok()?;
            }
            Self::Open => line.push(b'O').ok()?,
            Self::Close => line.push(b'C').ok()?,
            Self::Ok => {}
            Self::Error => {
                line.push(BELL).ok()?;
                return Some(line);
            }
            Self::Other(_) => return None,
        }
        line.push(END).ok()?;
        Some(line)
    }
}

fn digits(line: &mut Line, value: u32, count: u32) -> Option<()> {
    (0..count).rev().try_for_each(|place| {
        let digit = value.wrapping_shr(place.wrapping_mul(4)) as u8 & 0xF;
        line.push(if digit < 10 { b'0' + digit } else { b'A' - 10 + digit }).ok()
    })
}

/// Reader that extracts messages from received bytes. A line that is too long or invalid is skipped up to its end.
#[derive(Clone, Debug, Default)]
pub struct Reader {
    line: Line,
    too_long: bool,
}

/// Length of the time stamp after a frame, digits. Adapters append one if a host requested it.
const STAMP: usize = 4;

impl Reader {
    /// Adds a received byte. Returns the message that it completes.
    pub fn push(&mut self, byte: u8) -> Option<Message> {
        match byte {
            BELL => {
                self.clear();
                Some(Message::Error)
            }
            // `slcand` and terminals may send both ends of a line.
            b'\n' => None,
            END => {
                let message = if self.too_long { None } else { parse(&self.line) };
                self.clear();
                message
            }
            _ => {
                self.too_long |= self.line.push(byte).is_err();
                None
            }
        }
    }

    fn clear(&mut self) {
        self.line.clear();
        self.too_long = false;
    }
}

fn parse(line: &[u8]) -> Option<Message> {
    let Some((&letter, rest)) = line.split_first() else { return Some(Message::Ok) };
    match (letter, rest) {
        (b't', _) => {
            let (id, data, len) = frame(rest, 3)?;
            let data = data.get(..len)?;
            Frame::standard(id as u16, data).map(Message::Frame)
        }
        (b'T', _) => {
            let (id, data, len) = frame(rest, 8)?;
            let data = data.get(..len)?;
            Frame::extended(id, data).map(Message::Frame)
        }
        (b'S', [digit @ b'0'..=b'8']) => Some(Message::Bitrate(digit - b'0')),
        (b'O', []) => Some(Message::Open),
        (b'C', []) => Some(Message::Close),
        (b'z' | b'Z', []) => Some(Message::Ok),
        _ => Some(Message::Other(letter)),
    }
}

/// Identifier, data and data length of a frame; the identifier has `id_digits` digits.
fn frame(text: &[u8], id_digits: usize) -> Option<(u32, [u8; 8], usize)> {
    let (id, rest) = text.split_at_checked(id_digits)?;
    let (len, rest) = rest.split_at_checked(1)?;
    let (id, len) = (hex(id)?, hex(len)? as usize);
    let (bytes, stamp) = rest.split_at_checked(len.checked_mul(2)?)?;
    let mut data = [0; 8];
    if len > data.len() || !(stamp.is_empty() || stamp.len() == STAMP && hex(stamp).is_some()) {
        return None;
    }
    for (slot, pair) in data.iter_mut().zip(bytes.chunks(2)) {
        *slot = hex(pair)? as u8;
    }
    Some((id, data, len))
}

fn hex(digits: &[u8]) -> Option<u32> {
    digits.iter().try_fold(0u32, |value, &digit| Some(value << 4 | char::from(digit).to_digit(16)?))
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn read(bytes: &[u8]) -> std::vec::Vec<Message> {
        let mut reader = Reader::default();
        bytes.iter().filter_map(|&byte| reader.push(byte)).collect()
    }

    fn standard(id: u16, data: &[u8]) -> Message {
        Message::Frame(Frame::standard(id, data).unwrap())
    }

    /// Checks examples of the manual, and the first bytes of `slcand -o -s8`.
    #[test]
    fn lines_of_the_manual() {
        assert_eq!(read(b"t10021133\r"), [standard(0x100, &[0x11, 0x33])]);
        assert_eq!(read(b"t1230\r"), [standard(0x123, &[])]);
        let extended = Frame::extended(0x100, &[0x11, 0x33]).unwrap();
        assert_eq!(read(b"T0000010021133\r"), [Message::Frame(extended)]);
        assert_eq!(read(b"C\rS8\rO\r"), [Message::Close, Message::Bitrate(8), Message::Open]);
        assert_eq!(read(b"\rz\r\x07"), [Message::Ok, Message::Ok, Message::Error]);
        assert_eq!(read(b"V\rN\r"), [Message::Other(b'V'), Message::Other(b'N')]);
        // A frame with a time stamp.
        assert_eq!(read(b"t1002113312AF\r"), [standard(0x100, &[0x11, 0x33])]);
        assert_eq!(standard(0x7FF, &[0xAB; 8]).encode().unwrap(), b"t7FF8ABABABABABABABAB\r");
        assert_eq!([bitrate_digit(1_000_000), bitrate_digit(10_000)], [Some(8), Some(0)]);
        assert_eq!(bitrate_digit(83_333), None);
    }

    #[test]
    fn what_has_no_line_is_not_encoded() {
        assert_eq!(Message::Bitrate(8).encode().as_deref(), Some(&b"S8\r"[..]));
        for digit in [9, 255] {
            assert_eq!(Message::Bitrate(digit).encode(), None);
        }
        assert_eq!(Message::Other(b'S').encode(), None);
    }

    #[test]
    fn what_is_no_line_is_skipped_up_to_its_end() {
        for bad in [
            &b"t8001FF\r"[..],
            b"t1239\r",
            b"t12320011223\r",
            b"t1232001\r",
            b"tXYZ0\r",
            // A time stamp that is not a number.
            b"t1230XYZW\r",
            b"T200000000\r",
            b"T1FFFFFFF8000102030405060708\r",
        ] {
            let mut line = bad.to_vec();
            line.extend(b"t1230\r");
            assert_eq!(read(&line), [standard(0x123, &[])], "{}", str::from_utf8(bad).unwrap());
        }
    }

    fn frame() -> impl Strategy<Value = Frame> {
        let data = || prop::collection::vec(any::<u8>(), 0..=8);
        prop_oneof![
            (0u16..0x800, data()).prop_map(|(id, d)| Frame::standard(id, &d).unwrap()),
            (0u32..1 << 29, data()).prop_map(|(id, d)| Frame::extended(id, &d).unwrap()),
        ]
    }

    proptest! {
        #[test]
        fn encoded_messages_are_read_back(frames in prop::collection::vec(frame(), 0..5)) {
            let messages: std::vec::Vec<_> = frames.into_iter().map(Message::Frame).collect();
            let lines: std::vec::Vec<u8> = messages.iter().flat_map(|s| s.encode().unwrap()).collect();
            prop_assert_eq!(read(&lines), messages);
        }

        #[test]
        fn no_bytes_stop_the_reader(bytes in prop::collection::vec(any::<u8>(), 0..80), frame in frame()) {
            let mut line = bytes;
            line.push(END);
            line.extend(Message::Frame(frame).encode().unwrap());
            prop_assert_eq!(read(&line).pop(), Some(Message::Frame(frame)));
        }
    }
}
