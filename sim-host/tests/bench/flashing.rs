//! Transfer of a library over links that accept frames slowly, or break.

use crate::{connect, rig, robot, transport_frames};
use rollwalk_bus::link::{LinkBus, LinkError};
use rollwalk_host::session::{Session, SessionError};
use rollwalk_protocol::can::Frame;
use rollwalk_protocol::wire::Node;
use rollwalk_sim_host::rig::Rig;
use std::sync::{Arc, Mutex};

/// Link whose transmit queue is full at every other attempt to send.
struct BusyLink {
    rig: Rig,
    tries: u32,
}

impl LinkBus for BusyLink {
    fn now_us(&self) -> u64 {
        self.rig.now_us()
    }

    fn send(&mut self, frame: &Frame) -> Result<(), LinkError> {
        self.tries += 1;
        if self.tries % 2 == 1 { Err(LinkError::Busy) } else { self.rig.send(frame) }
    }

    fn receive(&mut self, deadline_us: u64) -> Result<Option<Frame>, LinkError> {
        self.rig.receive(deadline_us)
    }
}

/// Link that carries `left` more frames of the host, and afterwards none in either direction.
struct BreakingLink {
    rig: Rig,
    left: u32,
}

impl LinkBus for BreakingLink {
    fn now_us(&self) -> u64 {
        self.rig.now_us()
    }

    fn send(&mut self, frame: &Frame) -> Result<(), LinkError> {
        self.left = self.left.saturating_sub(1);
        if self.left == 0 { Ok(()) } else { self.rig.send(frame) }
    }

    fn receive(&mut self, deadline_us: u64) -> Result<Option<Frame>, LinkError> {
        let frame = self.rig.receive(deadline_us)?;
        Ok(frame.filter(|_| self.left > 0))
    }
}

#[test]
fn a_frame_that_finds_the_queue_full_is_kept() {
    let mut plain = connect(rig());
    plain.flash(&robot::library(), |_| {}).unwrap();
    let mut busy = connect(BusyLink { rig: rig(), tries: 0 });
    busy.flash(&robot::library(), |_| {}).unwrap();
    let (plain, busy) = (plain.into_bus(), busy.into_bus());
    let frames = |rig| transport_frames(rig).count();
    assert_eq!(frames(&busy.rig), frames(&plain), "none was sent again");
}

/// A host with the answer may switch the robot off, so the library must be saved before the answer.
#[test]
fn a_library_is_kept_before_its_host_is_told() {
    let library = robot::library();
    for is_kept in [true, false] {
        let kept = Arc::new(Mutex::new(Vec::new()));
        let mut rig = rig();
        let files = Arc::clone(&kept);
        rig.core_mut().keep_libraries(Box::new(move |file| {
            files.lock().unwrap().push(file.to_vec());
            is_kept
        }));
        let mut session = connect(rig);
        let flashed = session.flash(&library, |_| {});
        assert_eq!(kept.lock().unwrap()[..], [library.to_vec()]);
        match flashed {
            Ok(_) => assert!(is_kept),
            Err(error) => {
                assert!(!is_kept && matches!(error, SessionError::Silent { .. }), "{error}");
            }
        }
    }
}

#[test]
fn a_transfer_over_a_link_that_broke_is_taken_up_where_it_stopped() {
    let library = robot::library();
    // Enough for a block of 512 bytes and a part of the next, with 7 bytes per frame.
    let mut session = connect(BreakingLink { rig: rig(), left: 100 });
    let error = session.flash(&library, |_| {}).unwrap_err();
    assert!(matches!(error, SessionError::Silent { node: 1, what: "transfer", .. }));

    let rig = session.into_bus().rig;
    let mut session = Session::connect(rig, Node::new(1).unwrap()).unwrap();
    let mut first = None;
    session.flash(&library, |progress| first = first.or(Some(progress.done))).unwrap();
    assert_eq!(first, Some(512));
    session.arm().unwrap();
}

/// Link that changes frames.
struct CorruptingLink<F> {
    rig: Rig,
    /// Function that returns the answers to a frame of the host. If there are none, the frame is passed on to the robot.
    sends: F,
    answers: Vec<Frame>,
    /// Replaces `next`, the number of bytes received, in the first answer to a transfer request.
    tells: Option<u16>,
}

impl<F: FnMut(&Frame) -> Vec<Frame>> LinkBus for CorruptingLink<F> {
    fn now_us(&self) -> u64 {
        self.rig.now_us()
    }

    fn send(&mut self, frame: &Frame) -> Result<(), LinkError> {
        let answers = (self.sends)(frame);
        if answers.is_empty() {
            return self.rig.send(frame);
        }
        self.answers = answers;
        Ok(())
    }

    fn receive(&mut self, deadline_us: u64) -> Result<Option<Frame>, LinkError> {
        if !self.answers.is_empty() {
            return Ok(Some(self.answers.remove(0)));
        }
        let Some(frame) = self.rig.receive(deadline_us)? else { return Ok(None) };
        // First frame of a REPLY: length, type, request, result, three bytes of `next`.
        if let &[0x10, 9, 0x90, request, result, _, _, last] = frame.data()
            && let Some(next) = self.tells.take()
        {
            let [low, high] = next.to_le_bytes();
            let data = [0x10, 9, 0x90, request, result, low, high, last];
            return Ok(Frame::new(frame.id(), &data));
        }
        Ok(Some(frame))
    }
}

#[test]
fn an_answer_that_tells_more_than_there_is_counts_as_lost() {
    let sends = |_: &Frame| Vec::new();
    let tells = Some(60_000);
    assert!(robot::library().len() < 60_000);
    let mut session = connect(CorruptingLink { rig: rig(), sends, answers: Vec::new(), tells });
    session.flash(&robot::library(), |_| {}).unwrap();
    assert_eq!(session.bus().tells, None);
}

#[test]
fn a_library_that_is_not_in_use_after_its_transfer_is_noticed() {
    // A node answers ACTIVATE but does not activate the library.
    let sends = |frame: &Frame| match frame.data() {
        &[5, 0x13, ..] => {
            let id = frame.standard_id().unwrap() | 1;
            let first = Frame::standard(id, &[0x10, 9, 0x90, 0x13, 0, 0, 0, 0]);
            let last = Frame::standard(id, &[0x21, 0, 0, 0]);
            [first, last].into_iter().flatten().collect()
        }
        _ => Vec::new(),
    };
    let mut session =
        connect(CorruptingLink { rig: rig(), sends, answers: Vec::new(), tells: None });
    let error = session.flash(&robot::library(), |_| {}).unwrap_err();
    assert_eq!(error, SessionError::NotInUse { found: None });
    assert_eq!(session.hello().library, None);
}
