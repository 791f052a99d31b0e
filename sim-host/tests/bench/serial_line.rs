//! Robot at a serial line of 1 Mbaud, in virtual time. Every byte takes ten bits; both directions are independent.

use rollwalk_bus::link::{LinkBus, LinkError};
use rollwalk_protocol::can::Frame;
use rollwalk_protocol::serial::{Deframer, Gateway, Line, Packet};
use rollwalk_sim_host::rig::Rig;
use std::collections::VecDeque;

/// Duration of a byte with start bit, eight data bits and stop bit, µs.
pub const BYTE_US: u64 = 10;

/// Bitrate of the simulated bus between line and controller, bit/s. A board has no such bus, so frames must cross it in almost
/// no time.
const NO_BUS: u32 = 1_000_000_000;

/// Host's end of the line.
pub struct SerialLine {
    pub rig: Rig,
    /// Number of bytes sent in both directions.
    pub bytes: u64,
    host: Gateway,
    controller: Gateway,
    to_host: Direction,
    to_controller: Direction,
    frames: VecDeque<Frame>,
}

#[derive(Default)]
struct Direction {
    deframer: Deframer,
    /// Packets with the times at which their last bytes arrive, µs.
    on_the_way: VecDeque<(u64, Line)>,
    free_us: u64,
}

impl Direction {
    fn put(&mut self, now_us: u64, packet: &Packet<'_>) -> u64 {
        let line = packet.encode().expect("everything fits a packet");
        let bytes = line.len() as u64;
        self.free_us = self.free_us.max(now_us) + bytes * BYTE_US;
        self.on_the_way.push_back((self.free_us, line));
        bytes
    }

    fn next_us(&self) -> Option<u64> {
        self.on_the_way.front().map(|(at_us, _)| *at_us)
    }

    /// Takes the next packet that has arrived. Returns its frame, or passes its message to `gateway`.
    fn take(&mut self, now_us: u64, gateway: &mut Gateway) -> Option<Frame> {
        let (_, line) = self.on_the_way.pop_front_if(|(at_us, _)| *at_us <= now_us)?;
        let packet = line.iter().fold(None, |found, &byte| {
            assert!(found.is_none(), "one packet");
            self.deframer.push(byte).map(<[u8]>::to_vec)
        });
        match Packet::decode(&packet.expect("nothing is damaged")).expect("one of ours") {
            Packet::Link(frame) => Some(frame),
            Packet::Message { id, bytes } => {
                gateway.receive(id, bytes);
                None
            }
            other => panic!("{other:?}"),
        }
    }
}

impl SerialLine {
    pub fn new(mut rig: Rig) -> Self {
        rig.set_link_bitrate(NO_BUS);
        Self {
            rig,
            bytes: 0,
            host: Gateway::default(),
            controller: Gateway::default(),
            to_host: Direction::default(),
            to_controller: Direction::default(),
            frames: VecDeque::new(),
        }
    }

    /// Passes arrived frames and messages to the controller. Returns false if it has no room for all of them.
    fn reach_controller(&mut self, now_us: u64) -> bool {
        self.frames.extend(self.to_controller.take(now_us, &mut self.controller));
        loop {
            while let Some(frame) = self.frames.front() {
                if self.rig.send(frame).is_err() {
                    return false;
                }
                self.frames.pop_front();
            }
            match self.controller.poll(now_us) {
                Some(frame) => self.frames.push_back(frame),
                None => return true,
            }
        }
    }
}

impl LinkBus for SerialLine {
    fn now_us(&self) -> u64 {
        self.rig.now_us()
    }

    fn send(&mut self, frame: &Frame) -> Result<(), LinkError> {
        let now_us = self.now_us();
        if let Some(packet) = self.host.send(now_us, frame) {
            self.bytes += self.to_controller.put(now_us, &packet);
        }
        Ok(())
    }

    fn receive(&mut self, deadline_us: u64) -> Result<Option<Frame>, LinkError> {
        loop {
            let now_us = self.now_us();
            let came = self.to_host.take(now_us, &mut self.host);
            if let Some(frame) = came.or_else(|| self.host.poll(now_us)) {
                return Ok(Some(frame));
            }
            let all_in = self.reach_controller(now_us);
            if now_us >= deadline_us {
                return Ok(None);
            }
            let full = (!all_in).then_some(now_us + 1);
            let next = [self.to_host.next_us(), self.to_controller.next_us(), full];
            let next_us = next.into_iter().flatten().fold(deadline_us, u64::min).max(now_us);
            if let Some(frame) = self.rig.receive(next_us)? {
                let now_us = self.now_us();
                if let Some(packet) = self.controller.send(now_us, &frame) {
                    self.bytes += self.to_host.put(now_us, &packet);
                }
            }
        }
    }
}
