//! The way of a library over links that are slow to take frames, or break.

use crate::{connect, rig, robot};
use rollwalk_bus::link::{LinkBus, LinkError};
use rollwalk_host::session::{Session, SessionError};
use rollwalk_protocol::can::CanFrame;
use rollwalk_protocol::wire::Node;
use rollwalk_sim_host::interface::Interface;
use rollwalk_sim_host::rig::Rig;

/// A link whose transmit queue is full at every other try.
struct Busy {
    rig: Rig,
    tries: u32,
}

impl LinkBus for Busy {
    fn now_us(&self) -> u64 {
        self.rig.now_us()
    }

    fn send(&mut self, frame: &CanFrame) -> Result<(), LinkError> {
        self.tries += 1;
        if self.tries % 2 == 1 { Err(LinkError::Busy) } else { self.rig.send(frame) }
    }

    fn receive(&mut self, deadline_us: u64) -> Result<Option<CanFrame>, LinkError> {
        self.rig.receive(deadline_us)
    }
}

/// A link that carries so many more frames of the host and then none either way.
struct Breaking {
    rig: Rig,
    left: u32,
}

impl LinkBus for Breaking {
    fn now_us(&self) -> u64 {
        self.rig.now_us()
    }

    fn send(&mut self, frame: &CanFrame) -> Result<(), LinkError> {
        self.left = self.left.saturating_sub(1);
        if self.left == 0 { Ok(()) } else { self.rig.send(frame) }
    }

    fn receive(&mut self, deadline_us: u64) -> Result<Option<CanFrame>, LinkError> {
        let frame = self.rig.receive(deadline_us)?;
        Ok(frame.filter(|_| self.left > 0))
    }
}

/// Frames of the host's transport on the link.
fn transport_frames(rig: &Rig) -> usize {
    let id = 0x500 | u16::from(rig.node().number()) << 4;
    let on_link = rig.log().iter().filter(|entry| entry.interface == Interface::Link);
    let frames = on_link.filter_map(|entry| entry.frame.standard());
    frames.filter(|frame| frame.id() == id).count()
}

#[test]
fn a_frame_that_finds_the_queue_full_is_kept() {
    let mut plain = connect(rig());
    plain.flash(&robot::library(), |_| {}).unwrap();
    let mut busy = connect(Busy { rig: rig(), tries: 0 });
    busy.flash(&robot::library(), |_| {}).unwrap();
    let (plain, busy) = (plain.into_bus(), busy.into_bus());
    assert_eq!(transport_frames(&busy.rig), transport_frames(&plain), "none was sent again");
}

#[test]
fn a_transfer_over_a_link_that_broke_is_taken_up_where_it_stopped() {
    let library = robot::library();
    // Enough for a block of 512 bytes and a piece of the next, at 7 bytes a frame.
    let mut session = connect(Breaking { rig: rig(), left: 100 });
    let error = session.flash(&library, |_| {}).unwrap_err();
    assert!(matches!(error, SessionError::Silent { node: 1, what: "transfer", .. }));

    let rig = session.into_bus().rig;
    let mut session = Session::connect(rig, Node::new(1).unwrap()).unwrap();
    let mut first = None;
    session.flash(&library, |progress| first = first.or(Some(progress.done))).unwrap();
    assert_eq!(first, Some(512));
    session.arm().unwrap();
}
