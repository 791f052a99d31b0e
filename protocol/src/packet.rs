//! Packets on a serial line, for [`crate::tunnel`] and [`crate::serial`]. A packet arrives whole or is dropped.
//!
//! A packet is `body · CRC-32C (little-endian)`, stuffed by COBS (Cheshire and Baker 1997) and terminated by a zero byte.

use crate::can::Frame;
use crate::crc::crc32c;
use cobs::{DecodeResult, DecoderState};
use heapless::Vec;

/// Length of the checksum, bytes.
pub(crate) const CRC_LEN: usize = 4;

/// Maximum number of bytes on the line, including the final zero, of a packet with up to `packet` bytes before stuffing.
pub(crate) const fn line_len(packet: usize) -> usize {
    cobs::max_encoding_length(packet) + 1
}

/// Appends bytes. If they do not fit, appends as many as fit and returns `None`. Replaces `extend_from_slice`, because the
/// compiler cannot prove that its length calculation does not overflow.
pub(crate) fn append<const N: usize>(to: &mut Vec<u8, N>, bytes: &[u8]) -> Option<()> {
    bytes.iter().try_for_each(|&byte| to.push(byte).ok())
}

/// Packet under construction, with at most `N` bytes including its checksum.
#[derive(Default)]
pub(crate) struct Writer<const N: usize>(Vec<u8, N>);

impl<const N: usize> Writer<N> {
    pub(crate) fn put(&mut self, bytes: &[u8]) -> Option<()> {
        append(&mut self.0, bytes)
    }

    /// Appends a frame; `None` if it has a 29-bit identifier, for which packets have no room.
    pub(crate) fn frame(&mut self, frame: &Frame) -> Option<()> {
        let [low, high] = frame.standard_id()?.to_le_bytes();
        self.put(&[low, high, frame.data().len() as u8])?;
        self.put(frame.data())
    }

    /// Bytes for the line; `L` is [`line_len`] of `N`.
    pub(crate) fn finish<const L: usize>(mut self) -> Option<Vec<u8, L>> {
        let crc = crc32c(&self.0);
        self.put(&crc.to_le_bytes())?;
        let mut line = Vec::new();
        line.resize_default(L).ok()?;
        let len = cobs::try_encode(&self.0, &mut line).ok()?;
        line.truncate(len);
        line.push(0).ok()?;
        Some(line)
    }
}

/// Unread rest of a packet's body.
pub(crate) struct Reader<'a>(pub(crate) &'a [u8]);

impl Reader<'_> {
    pub(crate) fn take<const N: usize>(&mut self) -> Option<[u8; N]> {
        let (head, rest) = self.0.split_first_chunk()?;
        self.0 = rest;
        Some(*head)
    }

    pub(crate) fn u32(&mut self) -> Option<u32> {
        self.take().map(u32::from_le_bytes)
    }

    pub(crate) fn frame(&mut self) -> Option<Frame> {
        let [low, high, len] = self.take()?;
        let (data, rest) = self.0.split_at_checked(len.into())?;
        self.0 = rest;
        Frame::standard(u16::from_le_bytes([low, high]), data)
    }
}

/// Extracts packets of at most `N` bytes from the bytes of a line. Any zero byte synchronises it, whatever bytes came before.
#[derive(Debug)]
pub struct Deframer<const N: usize> {
    packet: Vec<u8, N>,
    cobs: DecoderState,
    /// True if the bytes since the last zero are not a packet.
    bad: bool,
    /// True if the previous byte completed a packet, which is still in the buffer.
    complete: bool,
}

impl<const N: usize> Default for Deframer<N> {
    fn default() -> Self {
        Self { packet: Vec::new(), cobs: DecoderState::Idle, bad: false, complete: false }
    }
}

impl<const N: usize> Deframer<N> {
    /// Adds a received byte. Returns the body of the packet that the byte completes. Drops damaged packets.
    pub fn push(&mut self, byte: u8) -> Option<&[u8]> {
        if core::mem::take(&mut self.complete) {
            self.packet.clear();
        }
        let fed = self.cobs.feed(byte);
        if byte != 0 {
            match fed {
                Ok(DecodeResult::DataContinue(data)) => self.bad |= self.packet.push(data).is_err(),
                Ok(DecodeResult::NoData) => {}
                Ok(DecodeResult::DataComplete) | Err(_) => self.bad = true,
            }
            return None;
        }
        self.cobs = DecoderState::Idle;
        self.complete = true;
        let whole =
            !core::mem::take(&mut self.bad) && matches!(fed, Ok(DecodeResult::DataComplete));
        let (body, crc) = self.packet.split_last_chunk::<CRC_LEN>()?;
        (whole && crc32c(body) == u32::from_le_bytes(*crc)).then_some(body)
    }
}
