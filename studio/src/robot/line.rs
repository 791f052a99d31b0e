//! Link of a real robot as a byte stream: packets of a serial line, or SLCAN.

use rollwalk_host::operator::Operator;
use rollwalk_protocol::can::Frame;
use rollwalk_protocol::serial::{Deframer, Gateway, Packet};
use rollwalk_protocol::slcan::{Message, Reader, bitrate_digit};

/// Bit rate of the link, bit/s.
const BITRATE: u32 = 1_000_000;

/// Encoding of frames as bytes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FrameEncoding {
    /// Packets of whole messages, on a line to a controller.
    Gateway,
    /// Packets of single frames, on a shared line.
    Frames,
    /// Lines of text for an SLCAN adapter.
    Slcan,
}

/// Line with its partially received data.
pub struct Line {
    coding: FrameEncoding,
    gateway: Gateway,
    deframer: Deframer,
    text: Reader,
    /// Bytes to send before the first frame.
    opening: Vec<u8>,
}

impl Line {
    /// Creates a line on which nothing was sent yet.
    pub fn new(coding: FrameEncoding) -> Self {
        let opening = match coding {
            // The first terminator ends a partial line of an earlier program.
            FrameEncoding::Slcan => {
                let bitrate = bitrate_digit(BITRATE).map(Message::Bitrate);
                let orders =
                    [Some(Message::Ok), Some(Message::Close), bitrate, Some(Message::Open)];
                orders
                    .into_iter()
                    .flatten()
                    .flat_map(|order| order.encode().unwrap_or_default())
                    .collect()
            }
            FrameEncoding::Gateway | FrameEncoding::Frames => Vec::new(),
        };
        let (gateway, deframer, text) = Default::default();
        Self { coding, gateway, deframer, text, opening }
    }

    /// Passes received bytes to the operator, and returns the bytes to send.
    pub fn exchange(&mut self, now_us: u64, received: &[u8], operator: &mut Operator) -> Vec<u8> {
        for &byte in received {
            if let Some(frame) = self.received(byte) {
                operator.on_frame(now_us, &frame);
            }
            while let Some(frame) = self.gateway.poll(now_us) {
                operator.on_frame(now_us, &frame);
            }
        }
        let mut sent = std::mem::take(&mut self.opening);
        while let Some(frame) = operator.poll(now_us) {
            self.send(now_us, &frame, &mut sent);
            while let Some(frame) = self.gateway.poll(now_us) {
                operator.on_frame(now_us, &frame);
            }
        }
        sent
    }

    fn received(&mut self, byte: u8) -> Option<Frame> {
        if self.coding == FrameEncoding::Slcan {
            return match self.text.push(byte) {
                Some(Message::Frame(frame)) => Some(frame),
                _ => None,
            };
        }
        match self.deframer.push(byte).and_then(Packet::decode)? {
            Packet::Link(frame) => Some(frame),
            Packet::Message { id, bytes } if self.coding == FrameEncoding::Gateway => {
                self.gateway.receive(id, bytes);
                None
            }
            Packet::Message { .. } | Packet::Report(_) | Packet::Ask => None,
        }
    }

    fn send(&mut self, now_us: u64, frame: &Frame, sent: &mut Vec<u8>) {
        let packet = match self.coding {
            FrameEncoding::Slcan => {
                sent.extend(Message::Frame(*frame).encode().unwrap_or_default());
                return;
            }
            FrameEncoding::Gateway => self.gateway.send(now_us, frame),
            FrameEncoding::Frames => Some(Packet::Link(*frame)),
        };
        if let Some(line) = packet.and_then(|packet| packet.encode()) {
            sent.extend_from_slice(&line);
        }
    }
}
