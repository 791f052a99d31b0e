//! Gateway between a program that uses ISO-TP and a serial line that does not need it. It reassembles messages of the
//! transport, sends them whole, and segments them again at the other end.
//!
//! On CAN, a block of a library takes 75 frames and 5 flow controls. One packet per frame would take 2.5 times the bytes of the
//! block, and six round trips. A whole block takes one packet with 11 bytes of overhead. Sessions and controllers need no
//! change: both ends look like a CAN bus.

use super::Packet;
use crate::can::Frame;
use crate::wire::isotp::{Event, Output, Timing};
use crate::wire::transport::{Endpoint, partner};

/// Timing without pauses and with a single flow control, since there is no bus between a program and its gateway.
const TIMING: Timing = Timing { block_size: 0, st_min: 0, timeout_us: 1_000_000 };

/// Gateway at one end of a line, identical for host and controller. It transfers one conversation at a time.
#[derive(Clone, Debug)]
pub struct Gateway {
    /// Identifier of the transport frames that this end sends.
    ours: u16,
    endpoint: Endpoint,
}

impl Default for Gateway {
    fn default() -> Self {
        Self { ours: 0, endpoint: Endpoint::new(TIMING) }
    }
}

impl Gateway {
    /// Accepts a frame sent at this end. Returns the packet for the line: the frame itself, or the message that it completes,
    /// or `None`. Call [`Self::poll`] afterwards.
    pub fn send(&mut self, now_us: u64, frame: &Frame) -> Option<Packet<'_>> {
        let Some(id) = frame.standard_id().filter(|&id| partner(id).is_some()) else {
            return Some(Packet::Link(*frame));
        };
        self.use_id(id);
        let whole = self.endpoint.on_frame(frame.data(), now_us) == Event::Received;
        whole.then(|| Packet::Message { id, bytes: self.endpoint.received() })
    }

    /// Accepts a message from the line; [`Self::poll`] returns its frames. Drops the remaining frames of an earlier message,
    /// which its sender has abandoned.
    pub fn receive(&mut self, id: u16, message: &[u8]) {
        if let Some(ours) = partner(id) {
            self.use_id(ours);
            self.endpoint.stop_sending();
            // Messages of packets always fit an endpoint.
            let _ = self.endpoint.send(message);
        }
    }

    /// Returns the next frame for this end; call it until it returns `None`.
    pub fn poll(&mut self, now_us: u64) -> Option<Frame> {
        // A failed message is dropped; the next one may follow at once.
        for _ in 0..3 {
            match self.endpoint.poll(now_us) {
                Output::Send(pdu) => return Some(pdu.frame(self.ours ^ 1)),
                Output::Failed(_) => {}
                Output::Idle => return None,
            }
        }
        None
    }

    /// Sets the identifier of this end's frames. A different identifier starts a new conversation.
    fn use_id(&mut self, id: u16) {
        if self.ours != id {
            self.ours = id;
            self.endpoint.reset();
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::serial::Deframer;
    use crate::wire::Node;
    use crate::wire::isotp::Pdu;
    use crate::wire::transport::{MAX_MESSAGE, frame_to_controller, frame_to_host};
    use proptest::prelude::*;
    use std::vec::Vec;

    const NODE: Node = Node::new(3).unwrap();

    /// Program that exchanges ISO-TP frames with a gateway at its end of a line.
    struct Program {
        endpoint: Endpoint,
        frame: fn(Node, &Pdu) -> Frame,
        gateway: Gateway,
        line: Deframer,
        received: Vec<Vec<u8>>,
        /// Number of packets put on the line.
        packets: usize,
    }

    impl Program {
        fn new(frame: fn(Node, &Pdu) -> Frame) -> Self {
            let (gateway, line) = (Gateway::default(), Deframer::default());
            let endpoint = Endpoint::new(Timing::default());
            Self { endpoint, frame, gateway, line, received: Vec::new(), packets: 0 }
        }

        /// Accepts bytes from the line, passes frames between program and gateway, and returns the bytes that they send.
        fn work(&mut self, bytes: &[u8]) -> Vec<u8> {
            for &byte in bytes {
                match self.line.push(byte).and_then(Packet::decode) {
                    Some(Packet::Message { id, bytes }) => self.gateway.receive(id, bytes),
                    Some(other) => panic!("{other:?}"),
                    None => {}
                }
            }
            let mut out = Vec::new();
            loop {
                let mut idle = true;
                while let Some(frame) = self.gateway.poll(0) {
                    idle = false;
                    if self.endpoint.on_frame(frame.data(), 0) == Event::Received {
                        self.received.push(self.endpoint.received().to_vec());
                    }
                }
                while let Output::Send(pdu) = self.endpoint.poll(0) {
                    idle = false;
                    if let Some(packet) = self.gateway.send(0, &(self.frame)(NODE, &pdu)) {
                        self.packets += 1;
                        out.extend_from_slice(&packet.encode().unwrap());
                    }
                }
                if idle {
                    return out;
                }
            }
        }
    }

    fn message(at_least: usize) -> impl Strategy<Value = Vec<u8>> {
        prop::collection::vec(any::<u8>(), at_least..=MAX_MESSAGE)
    }

    proptest! {
        #[test]
        fn every_message_crosses_in_one_packet(asked in message(1), answered in message(1)) {
            let mut host = Program::new(frame_to_controller);
            let mut controller = Program::new(frame_to_host);
            for round in 1..=2 {
                host.endpoint.send(&asked).unwrap();
                let there = host.work(&[]);
                prop_assert!(controller.work(&there).is_empty());
                controller.endpoint.send(&answered).unwrap();
                let back = controller.work(&[]);
                prop_assert!(host.work(&back).is_empty());
                prop_assert_eq!(controller.received.last(), Some(&asked));
                prop_assert_eq!(host.received.last(), Some(&answered));
                prop_assert_eq!((host.packets, controller.packets), (round, round));
            }
        }

        /// Either end may abandon a message at any frame; the next message still arrives.
        #[test]
        fn a_message_that_was_left_half_way_is_in_nobody_s_way(
            asked in message(8), frames in 0usize..80,
        ) {
            let mut host = Program::new(frame_to_controller);
            let mut controller = Program::new(frame_to_host);
            // A message of which the controller took only the first frame.
            controller.gateway.receive(0x530, &[7; 100]);
            controller.gateway.poll(0);
            // A message that the host did not send completely.
            host.endpoint.send(&asked).unwrap();
            for _ in 0..frames {
                if let Output::Send(pdu) = host.endpoint.poll(0) {
                    let _ = host.gateway.send(0, &frame_to_controller(NODE, &pdu));
                }
                while let Some(frame) = host.gateway.poll(0) {
                    host.endpoint.on_frame(frame.data(), 0);
                }
            }
            host.endpoint.reset();
            host.endpoint.send(&asked).unwrap();
            let line = host.work(&[]);
            controller.work(&line);
            prop_assert_eq!(controller.received, [asked]);
        }
    }

    #[test]
    fn other_frames_cross_as_they_are() {
        let mut gateway = Gateway::default();
        for id in [0x030, 0x130, 0x234, 0x512, 0x7FF] {
            let frame = Frame::standard(id, &[0x10, 9, 1, 2, 3, 4, 5, 6]).unwrap();
            assert_eq!(gateway.send(0, &frame), Some(Packet::Link(frame)));
            assert_eq!(gateway.poll(0), None);
        }
        // A message under an identifier outside the transport is ignored.
        gateway.receive(0x234, &[1, 2, 3]);
        assert_eq!(gateway.poll(0), None);
    }
}
