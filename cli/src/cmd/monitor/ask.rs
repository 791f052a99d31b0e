//! Identity request of a monitor, for the names of its robot and library. The request waits until other programs' transfers
//! end; frames received meanwhile are kept.

use super::since_1970_us;
use rollwalk_bus::link::{LinkBus, LinkError};
use rollwalk_host::listener::{self, Listener};
use rollwalk_host::session::Session;
use rollwalk_protocol::can::Frame;
use rollwalk_protocol::wire::Node;
use rollwalk_protocol::wire::transport::Hello;

/// Link that records every frame with its time, µs since 1970.
struct RecordingLink<'a, B> {
    bus: &'a mut B,
    frames: &'a mut Vec<(u64, Frame)>,
}

impl<B: LinkBus> LinkBus for RecordingLink<'_, B> {
    fn now_us(&self) -> u64 {
        self.bus.now_us()
    }

    fn send(&mut self, frame: &Frame) -> Result<(), LinkError> {
        self.bus.send(frame)?;
        self.frames.push((since_1970_us(), *frame));
        Ok(())
    }

    fn fault_and_remedy(&self) -> Option<String> {
        self.bus.fault_and_remedy()
    }

    fn receive(&mut self, deadline_us: u64) -> Result<Option<Frame>, LinkError> {
        let frame = self.bus.receive(deadline_us)?;
        self.frames.extend(frame.map(|frame| (since_1970_us(), frame)));
        Ok(frame)
    }
}

/// Reads the identity of controller `node`. Returns `None` if the controller is silent or does not answer before `end_us`.
/// Frames received meanwhile are appended to `frames`.
pub fn identity(
    bus: &mut impl LinkBus,
    node: Node,
    end_us: u64,
    frames: &mut Vec<(u64, Frame)>,
) -> Option<Hello> {
    let mut bus = RecordingLink { bus, frames };
    let now_us = bus.now_us();
    let timeout_us = listener::PAUSE_TIMEOUT_US.min(end_us.saturating_sub(now_us));
    let listener = listener::find_pause(&mut bus, Listener::new(now_us, node), timeout_us).ok()?;
    // Neither a replayed log nor a controller that is off would answer.
    if !listener.has_controller() || !listener.may_ask(bus.now_us()) {
        return None;
    }
    Some(*Session::visit(&mut bus, node).ok()?.hello())
}

#[cfg(test)]
mod tests {
    use super::*;
    use rollwalk_protocol::faults::{FaultBits, Severity};
    use rollwalk_protocol::wire::{State, Status};

    /// Bus on which a frame arrives every 20 ms of virtual time.
    struct Wire {
        now_us: u64,
        frame: Frame,
        sent: Vec<Frame>,
    }

    impl LinkBus for Wire {
        fn now_us(&self) -> u64 {
            self.now_us
        }

        fn send(&mut self, frame: &Frame) -> Result<(), LinkError> {
            self.sent.push(*frame);
            Ok(())
        }

        fn receive(&mut self, deadline_us: u64) -> Result<Option<Frame>, LinkError> {
            let next_us = (self.now_us / 20_000 + 1) * 20_000;
            self.now_us = next_us.min(deadline_us);
            Ok((next_us <= deadline_us).then_some(self.frame))
        }
    }

    fn ask(frame: Frame, end_us: u64) -> (Wire, Vec<(u64, Frame)>) {
        let mut wire = Wire { now_us: 0, frame, sent: Vec::new() };
        let mut frames = Vec::new();
        assert_eq!(identity(&mut wire, Node::new(1).unwrap(), end_us, &mut frames), None);
        (wire, frames)
    }

    fn status() -> Frame {
        let (state, severity, faults) = (State::Ready, Severity::None, FaultBits::default());
        Status { state, severity, faults, clip: None, frame: 0, counter: 0, library: 0 }
            .encode(Node::new(1).unwrap())
    }

    #[test]
    fn every_frame_is_kept_from_the_first_on_and_what_is_sent_too() {
        let (wire, frames) = ask(status(), u64::MAX);
        assert!(!wire.sent.is_empty());
        let heard = (wire.now_us / 20_000) as usize;
        assert_eq!(frames.len(), heard + wire.sent.len());
        // The program first listens for half a second.
        assert!(frames[..25].iter().all(|(_, frame)| *frame == status()));
    }

    #[test]
    fn nothing_is_asked_in_the_middle_of_a_transfer_or_of_nobody_or_when_time_is_up() {
        let block = Frame::standard(0x510, &[0x21, 1, 2, 3]).unwrap();
        let foreign = Frame::standard(0x123, &[1]).unwrap();
        for (frame, end_us, lasts_us) in [
            (block, u64::MAX, listener::PAUSE_TIMEOUT_US),
            (foreign, u64::MAX, 500_000),
            (status(), 300_000, 300_000),
        ] {
            let (wire, frames) = ask(frame, end_us);
            assert_eq!(wire.sent, []);
            assert_eq!(wire.now_us, lasts_us);
            assert_eq!(frames.len() as u64, lasts_us / 20_000);
        }
    }
}
