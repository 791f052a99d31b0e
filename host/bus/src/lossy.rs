//! Link that loses frames, wrapped around another bus.

use crate::link::{LinkBus, LinkError};
use rollwalk_protocol::can::Frame;

/// Bus that loses random frames in both directions, reproducibly for a seed.
#[derive(Clone, Debug)]
pub struct Lossy<B> {
    bus: B,
    per_mille: u64,
    random: u64,
    lost: u64,
}

impl<B> Lossy<B> {
    /// Creates a bus that loses `per_mille` frames in a thousand on average.
    pub fn new(bus: B, per_mille: u16, seed: u64) -> Self {
        Self { bus, per_mille: per_mille.into(), random: seed, lost: 0 }
    }

    /// Wrapped bus.
    pub fn inner(&self) -> &B {
        &self.bus
    }

    /// Number of lost frames. A test of losses must check that it is not zero.
    pub fn lost(&self) -> u64 {
        self.lost
    }

    fn loses(&mut self) -> bool {
        // SplitMix64 (Steele, Lea, Flood 2014).
        self.random = self.random.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut x = self.random;
        x = (x ^ (x >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        x = (x ^ (x >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        let loses = (x ^ (x >> 31)) % 1000 < self.per_mille;
        self.lost += u64::from(loses);
        loses
    }
}

impl<B: LinkBus> LinkBus for Lossy<B> {
    fn now_us(&self) -> u64 {
        self.bus.now_us()
    }

    fn send(&mut self, frame: &Frame) -> Result<(), LinkError> {
        if self.loses() { Ok(()) } else { self.bus.send(frame) }
    }

    fn receive(&mut self, deadline_us: u64) -> Result<Option<Frame>, LinkError> {
        loop {
            match self.bus.receive(deadline_us)? {
                Some(_) if self.loses() => {}
                other => return Ok(other),
            }
        }
    }
}
