//! The robot of a run, shared by the host that talks to it and the story that disturbs it.

use rollwalk_bus::link::{LinkBus, LinkError};
use rollwalk_protocol::can::Frame;
use rollwalk_sim_host::clock::SimTime;
use rollwalk_sim_host::core::Core;
use rollwalk_sim_host::rig::Rig;
use std::cell::{RefCell, RefMut};
use std::rc::Rc;

/// A rig with several owners.
pub struct Bench<C>(Rc<RefCell<Rig<C>>>);

impl<C> Clone for Bench<C> {
    fn clone(&self) -> Self {
        Self(Rc::clone(&self.0))
    }
}

impl<C: Core> Bench<C> {
    /// Of a rig.
    pub fn new(rig: Rig<C>) -> Self {
        Self(Rc::new(RefCell::new(rig)))
    }

    /// The rig, for a moment.
    pub fn rig(&self) -> RefMut<'_, Rig<C>> {
        self.0.borrow_mut()
    }

    /// The present instant.
    pub fn now(&self) -> SimTime {
        self.rig().now()
    }

    /// Lets time pass without anybody at the host's end.
    pub fn abandon_until(&self, until: SimTime) {
        let mut rig = self.rig();
        rig.run_until(until);
        // Nobody takes them.
        let now_us = rig.now_us();
        while matches!(rig.receive(now_us), Ok(Some(_))) {}
    }
}

impl<C: Core> LinkBus for Bench<C> {
    fn now_us(&self) -> u64 {
        self.rig().now_us()
    }

    fn send(&mut self, frame: &Frame) -> Result<(), LinkError> {
        self.rig().send(frame)
    }

    fn receive(&mut self, deadline_us: u64) -> Result<Option<Frame>, LinkError> {
        self.rig().receive(deadline_us)
    }
}
