//! Core of the relay, without socket, bus or clock: converts packets of a page to frames for a bus, and frames to packets.
//!
//! A page sends complete packets of single frames ([`Packet::Link`]), any number in a message. If a message contains anything
//! else, none of it is sent. Frames wait in order for a busy bus, but only for a short time: when a dead bus recovers, old
//! heartbeats and commands must not be sent.

use rollwalk_protocol::can::Frame;
use rollwalk_protocol::serial::{Deframer, Packet};
use std::collections::VecDeque;

/// Maximum number of frames that wait for the bus. A page sends its heartbeat, a command, and at most sixteen frames of a
/// message before the controller answers.
const WAITING_MAX: usize = 256;
/// Maximum waiting time of a frame for the bus, µs: two heartbeats.
const WAIT_MAX_US: u64 = 100_000;

/// Misuse by a page; pages of the studio never cause it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum Misuse {
    /// Bytes that are not complete packets of single frames.
    #[error("the page sent bytes that are not packets of frames")]
    NoFrames,
    /// More frames than the bus can carry.
    #[error("the page sends more frames than the bus can carry")]
    TooMany,
}

/// Traffic between one page and the bus.
#[derive(Default)]
pub struct Traffic {
    /// Frames for the bus, each with the start of its wait, µs.
    waiting: VecDeque<(u64, Frame)>,
    /// Packets for the page.
    outgoing: Vec<u8>,
}

impl Traffic {
    /// Accepts a message of the page, completely or not at all.
    ///
    /// # Errors
    /// Returns an error if the message contains anything but packets of single frames, or if too many frames wait.
    pub fn page_sent(&mut self, now_us: u64, message: &[u8]) -> Result<(), Misuse> {
        let mut deframer = Deframer::default();
        let mut frames = Vec::new();
        for packet in message.split_inclusive(|byte| *byte == 0) {
            // Only a packet that ends with zero is complete.
            let found = packet.iter().fold(None, |_, &byte| match deframer.push(byte) {
                Some(packet) => Packet::decode(packet).and_then(link_frame),
                None => None,
            });
            frames.push((now_us, found.ok_or(Misuse::NoFrames)?));
        }
        if self.waiting.len() + frames.len() > WAITING_MAX {
            return Err(Misuse::TooMany);
        }
        self.waiting.extend(frames);
        Ok(())
    }

    /// Returns the next frame for the bus, which stays the next until [`sent`](Self::sent) is called. Frames that have waited
    /// too long are dropped.
    pub fn for_bus(&mut self, now_us: u64) -> Option<Frame> {
        while let Some((since_us, frame)) = self.waiting.front() {
            if now_us.saturating_sub(*since_us) <= WAIT_MAX_US {
                return Some(*frame);
            }
            self.waiting.pop_front();
        }
        None
    }

    /// Removes the frame that the bus has accepted.
    pub fn sent(&mut self) {
        self.waiting.pop_front();
    }

    /// Adds a frame of the bus for the page.
    pub fn bus_sent(&mut self, frame: &Frame) {
        if let Some(line) = Packet::Link(*frame).encode() {
            self.outgoing.extend_from_slice(&line);
        }
    }

    /// Returns a message for the page, if frames wait for it.
    pub fn for_page(&mut self) -> Option<Vec<u8>> {
        (!self.outgoing.is_empty()).then(|| std::mem::take(&mut self.outgoing))
    }
}

fn link_frame(packet: Packet<'_>) -> Option<Frame> {
    match packet {
        Packet::Link(frame) => Some(frame),
        Packet::Message { .. } | Packet::Ask | Packet::Report(_) => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn frame(id: u16) -> Frame {
        Frame::standard(id, &id.to_le_bytes()).unwrap()
    }

    fn message(frames: &[Frame]) -> Vec<u8> {
        frames.iter().flat_map(|frame| Packet::Link(*frame).encode().unwrap()).collect()
    }

    /// Returns all frames that would be sent to the bus now.
    fn taken(traffic: &mut Traffic, now_us: u64) -> Vec<Frame> {
        std::iter::from_fn(|| {
            let frame = traffic.for_bus(now_us)?;
            traffic.sent();
            Some(frame)
        })
        .collect()
    }

    #[test]
    fn frames_pass_both_ways_in_order() {
        let mut traffic = Traffic::default();
        let frames = [frame(1), frame(2), frame(3)];
        traffic.page_sent(0, &message(&frames)).unwrap();
        // A busy bus takes no frames; they are offered again.
        assert_eq!(traffic.for_bus(0), traffic.for_bus(1));
        assert_eq!(taken(&mut traffic, 1), frames);
        assert_eq!(traffic.for_page(), None);
        frames.iter().for_each(|frame| traffic.bus_sent(frame));
        assert_eq!(traffic.for_page(), Some(message(&frames)));
        assert_eq!(traffic.for_page(), None);
    }

    #[test]
    fn what_no_page_of_ours_sends_is_refused_whole() {
        let good = message(&[frame(1)]);
        let encoded = |packet: Packet<'_>| packet.encode().unwrap().to_vec();
        let damaged: Vec<u8> = good.iter().map(|byte| byte ^ u8::from(*byte > 2)).collect();
        for bad in [
            encoded(Packet::Ask),
            encoded(Packet::Message { id: 0x520, bytes: &[1, 2] }),
            good[..good.len() - 1].to_vec(),
            damaged,
            vec![0],
            vec![0xff; 10_000],
        ] {
            let mut traffic = Traffic::default();
            let sent = [&good, &bad[..]].concat();
            assert_eq!(traffic.page_sent(0, &sent), Err(Misuse::NoFrames), "{bad:02x?}");
            assert_eq!(traffic.for_bus(0), None, "{bad:02x?}");
        }
        assert_eq!(Traffic::default().page_sent(0, &[]), Ok(()));
        let flood = message(&[frame(1); WAITING_MAX + 1]);
        assert_eq!(Traffic::default().page_sent(0, &flood), Err(Misuse::TooMany));
    }

    proptest! {
        #[test]
        fn any_bytes_are_frames_or_refused(bytes in prop::collection::vec(any::<u8>(), 0..200)) {
            let mut traffic = Traffic::default();
            let taken_in = traffic.page_sent(0, &bytes);
            let frames = taken(&mut traffic, 0);
            prop_assert!(taken_in.is_ok() || frames.is_empty());
        }

        /// Checks that frames keep their order on a bus that is alternately busy and free, and that no frame is too old.
        #[test]
        fn nothing_stale_goes_out(
            steps in prop::collection::vec((0_u64..60_000, 0_u16..4, any::<bool>()), 1..100),
        ) {
            let mut traffic = Traffic::default();
            let (mut now_us, mut next) = (0, 0);
            let mut offered = std::collections::BTreeMap::new();
            let mut last = None;
            for (step_us, count, is_free) in steps {
                now_us += step_us;
                let frames: Vec<Frame> = (next..next + count).map(frame).collect();
                if traffic.page_sent(now_us, &message(&frames)).is_ok() {
                    offered.extend(frames.iter().map(|frame| (frame.standard_id(), now_us)));
                }
                next += count;
                if is_free {
                    for frame in taken(&mut traffic, now_us) {
                        let id = frame.standard_id();
                        prop_assert!(id > last);
                        prop_assert!(now_us - offered[&id] <= WAIT_MAX_US);
                        last = id;
                    }
                }
            }
        }
    }
}
