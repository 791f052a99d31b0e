//! Link on which Ctrl-C interrupts every wait.

use crate::interrupt;
use rollwalk_bus::link::{LinkBus, LinkError};
use rollwalk_bus::port::LiveLink;
use rollwalk_protocol::can::Frame;

/// Interval between checks for Ctrl-C, µs.
const CHECK_US: u64 = 50_000;

pub struct Interruptible {
    live: LiveLink,
    /// True if Ctrl-C is ignored because the robot is returning to SAFE.
    ignores: bool,
}

impl Interruptible {
    /// Wraps a link so that Ctrl-C interrupts its waits.
    pub fn new(live: LiveLink) -> Self {
        Self { live, ignores: false }
    }

    /// Bit rate of the bus, bit/s; `None` if unknown.
    pub fn bitrate(&self) -> Option<u32> {
        self.live.bitrate()
    }

    /// Ignores Ctrl-C from now on.
    pub fn ignore_interrupts(&mut self) {
        self.ignores = true;
    }
}

impl LinkBus for Interruptible {
    fn now_us(&self) -> u64 {
        self.live.now_us()
    }

    fn send(&mut self, frame: &Frame) -> Result<(), LinkError> {
        self.live.send(frame)
    }

    fn receive(&mut self, deadline_us: u64) -> Result<Option<Frame>, LinkError> {
        loop {
            if interrupt::requested() && !self.ignores {
                return Err(LinkError::Down("interrupted".into()));
            }
            let until_us = deadline_us.min(self.now_us() + CHECK_US);
            let frame = self.live.receive(until_us)?;
            if frame.is_some() || until_us == deadline_us {
                return Ok(frame);
            }
        }
    }

    fn fault_and_remedy(&self) -> Option<String> {
        self.live.fault_and_remedy()
    }
}
