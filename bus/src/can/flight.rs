//! Frames of ours that the kernel has and the bus has not: few, and known one by one.
//!
//! The kernel hands every frame back when it has left. Until then it counts, and with too many on their way no
//! more are taken: what waits elsewhere can still be replaced by something newer, and what waits here can not.
//! An interface whose frames stay away is stuck: briefly when an adapter stalls, for good when nobody
//! acknowledges.

use rollwalk_protocol::can::AnyFrame;
use std::collections::VecDeque;

/// Frames on their way.
#[derive(Clone, Debug)]
pub struct Flight {
    depth: usize,
    frames: VecDeque<AnyFrame>,
    /// When something left last, or the first of these was sent.
    since_us: u64,
}

impl Flight {
    /// None yet, and never more than `depth`.
    pub fn new(depth: usize) -> Self {
        Self { depth: depth.max(1), frames: VecDeque::new(), since_us: 0 }
    }

    /// Whether there is room for another.
    pub fn has_room(&self) -> bool {
        self.frames.len() < self.depth
    }

    /// A frame was handed to the kernel.
    pub fn took_off(&mut self, now_us: u64, frame: AnyFrame) {
        if self.frames.is_empty() {
            self.since_us = now_us;
        }
        self.frames.push_back(frame);
    }

    /// A frame was heard; whether it is one of ours that has left. Frames leave in their order, so those
    /// before it got lost.
    pub fn landed(&mut self, now_us: u64, frame: &AnyFrame) -> bool {
        let Some(at) = self.frames.iter().position(|ours| ours == frame) else { return false };
        self.frames.drain(..=at);
        self.since_us = now_us;
        true
    }

    /// The interface has thrown away what it had.
    pub fn clear(&mut self) {
        self.frames.clear();
    }

    /// For how long nothing has left although something should, µs.
    pub fn stuck_us(&self, now_us: u64) -> u64 {
        if self.frames.is_empty() { 0 } else { now_us.saturating_sub(self.since_us) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rollwalk_protocol::can::CanFrame;

    fn frame(id: u16) -> AnyFrame {
        CanFrame::new(id, &[1]).unwrap().into()
    }

    #[test]
    fn there_are_never_more_than_so_many() {
        let mut flight = Flight::new(2);
        flight.took_off(10, frame(1));
        assert!(flight.has_room());
        flight.took_off(20, frame(2));
        assert!(!flight.has_room());
        assert!(!flight.landed(30, &frame(3)), "somebody else's");
        assert!(!flight.has_room());
        assert!(flight.landed(30, &frame(1)));
        assert!(flight.has_room());
    }

    #[test]
    fn those_that_got_lost_do_not_count_for_ever() {
        let mut flight = Flight::new(2);
        flight.took_off(10, frame(1));
        flight.took_off(20, frame(2));
        assert!(flight.landed(30, &frame(2)));
        assert_eq!(flight.stuck_us(1000), 0);
        assert!(!flight.landed(40, &frame(1)));
    }

    #[test]
    fn it_is_stuck_since_something_left_last() {
        let mut flight = Flight::new(4);
        assert_eq!(flight.stuck_us(500), 0);
        flight.took_off(1000, frame(1));
        flight.took_off(3000, frame(2));
        assert_eq!(flight.stuck_us(5000), 4000);
        flight.landed(6000, &frame(1));
        assert_eq!(flight.stuck_us(9000), 3000);
        flight.clear();
        assert_eq!(flight.stuck_us(9000), 0);
    }
}
