//! Frames in flight: those that the kernel has accepted and not yet echoed as transmitted.
//!
//! Their number is limited, because a frame in the kernel's queue cannot be replaced by a newer one. The kernel echoes every
//! transmitted frame, which makes room for another.
//!
//! Without an echo, the interface is stuck: temporarily if an adapter stalls, permanently if no node acknowledges. A driver may
//! also have dropped the frames, and would accept others. To find out, the host tries another frame although there is no room. It
//! does so only a few times, because all these frames are stale when a node acknowledges again.
//!
//! For each frame that it tries, the host gives up the oldest one. A frame that was given up may still be transmitted, mostly
//! when a dead bus recovers. The host recognises its echo too, so that it is not mistaken for a frame of another node.

use rollwalk_protocol::can::Frame;
use std::collections::VecDeque;

/// Time without a transmission after which another frame may be tried, µs.
const PROBE_US: u64 = 1_000_000;
/// Maximum number of frames that the host tries in this way before one is transmitted.
const PROBES: u8 = 2;

/// Queue of frames in flight.
#[derive(Clone, Debug)]
pub struct Flight {
    depth: usize,
    /// Frames in flight, in the order of transmission.
    frames: VecDeque<Frame>,
    /// Older frames that were given up but may still be transmitted.
    given_up: VecDeque<Frame>,
    /// Time of the latest transmission, or of sending the first of `frames` if that is later, µs.
    since_us: u64,
    /// Number of frames tried since the latest transmission.
    probes: u8,
}

impl Flight {
    /// Creates an empty queue for at most `depth` frames in flight.
    pub fn new(depth: usize) -> Self {
        let (frames, given_up) = (VecDeque::new(), VecDeque::new());
        Self { depth: depth.max(1), frames, given_up, since_us: 0, probes: 0 }
    }

    /// True if another frame may be sent.
    pub fn has_room(&self) -> bool {
        self.frames.len() < self.depth
    }

    /// True if one more frame may be tried on a stuck interface.
    pub fn may_try(&self, now_us: u64) -> bool {
        self.probes < PROBES && self.stuck_us(now_us) > PROBE_US
    }

    /// Records a frame passed to the kernel.
    pub fn took_off(&mut self, now_us: u64, frame: Frame) {
        if self.frames.len() >= self.depth {
            // The frame counts as lost, so another may be tried.
            self.give_up(1);
            self.probes += 1;
            self.since_us = now_us;
        }
        if self.frames.is_empty() {
            self.since_us = now_us;
        }
        self.frames.push_back(frame);
    }

    /// Processes a received frame; returns true if it is the echo of a sent one. Frames are transmitted in order, so older
    /// frames without an echo are lost.
    pub fn landed(&mut self, now_us: u64, frame: &Frame) -> bool {
        let find = |frames: &VecDeque<_>| frames.iter().position(|ours| ours == frame);
        match (find(&self.given_up), find(&self.frames)) {
            (None, None) => return false,
            (None, Some(at)) => {
                self.given_up.clear();
                self.frames.drain(..=at);
            }
            (Some(at), later) => {
                self.given_up.drain(..=at);
                // Two sent frames are equal, and the echo may belong to either. The frames up to the later one are given up: if
                // that frame was lost, there would never be room again. Their echoes are still recognised.
                self.give_up(later.map_or(0, |later| later + 1));
            }
        }
        self.since_us = now_us;
        self.probes = 0;
        true
    }

    /// Gives up the first `count` frames in flight.
    fn give_up(&mut self, count: usize) {
        self.given_up.extend(self.frames.drain(..count));
        let too_many = self.given_up.len().saturating_sub(self.depth + usize::from(PROBES));
        self.given_up.drain(..too_many);
    }

    /// Drops all frames, because the interface has emptied its queue.
    pub fn clear(&mut self) {
        self.frames.clear();
        self.given_up.clear();
        self.probes = 0;
    }

    /// Time since the latest transmission while frames are in flight, µs; otherwise 0.
    pub fn stuck_us(&self, now_us: u64) -> u64 {
        if self.frames.is_empty() { 0 } else { now_us.saturating_sub(self.since_us) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rollwalk_protocol::can::Frame;

    fn frame(id: u16) -> Frame {
        Frame::standard(id, &[1]).unwrap()
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
    fn a_stuck_interface_is_tried_twice_and_serves_again_when_it_lost_its_frames() {
        let mut flight = Flight::new(1);
        flight.took_off(0, frame(1));
        let mut tried = Vec::new();
        for now_us in (0..20_000_000).step_by(10_000) {
            if flight.has_room() || flight.may_try(now_us) {
                flight.took_off(now_us, frame(2));
                tried.push(now_us / 1_000_000);
            }
        }
        assert_eq!(tried, [1, 2]);
        // The driver had lost only the first frame.
        assert!(flight.landed(20_000_000, &frame(2)));
        assert!(flight.has_room());
    }

    #[test]
    fn those_that_were_given_up_are_still_ours_when_they_leave_after_all() {
        let mut flight = Flight::new(1);
        // The first frame, then two that are tried while no node acknowledges.
        for (id, now_us) in [(1, 0), (2, 1_100_000), (3, 2_200_000)] {
            assert!(flight.has_room() || flight.may_try(now_us));
            flight.took_off(now_us, frame(id));
        }
        // A node acknowledges again.
        assert!(flight.landed(3_000_000, &frame(1)));
        assert_eq!(flight.stuck_us(3_000_500), 500);
        assert!(!flight.landed(3_000_600, &frame(1)), "somebody else says the same");
        assert!(flight.landed(3_001_000, &frame(2)));
        assert!(!flight.has_room());
        assert!(flight.landed(3_002_000, &frame(3)));
        assert!(flight.has_room());
        assert!(!flight.landed(3_003_000, &frame(2)));
    }

    #[test]
    fn of_equal_frames_either_may_have_got_lost() {
        let stuck = || {
            let mut flight = Flight::new(2);
            for (id, now_us) in [(1, 0), (2, 0), (1, 1_100_000), (2, 2_200_000)] {
                assert!(flight.has_room() || flight.may_try(now_us));
                flight.took_off(now_us, frame(id));
            }
            flight
        };
        // All four echoes are ours.
        let mut flight = stuck();
        assert!([1, 2, 1, 2].iter().all(|id| flight.landed(3_000_000, &frame(*id))));
        assert!(flight.has_room());
        // After the first two, there is room as soon as the others have left.
        let mut flight = stuck();
        assert!([1, 2].iter().all(|id| flight.landed(3_000_000, &frame(*id))));
        flight.took_off(3_000_000, frame(1));
        assert!(flight.has_room());
        assert!(flight.landed(3_001_000, &frame(1)));
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
