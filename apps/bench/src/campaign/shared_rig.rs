//! Simulated robot of a run, shared between the host session that controls it and the run that disturbs it.

use rollwalk_bus::link::{LinkBus, LinkError};
use rollwalk_protocol::can::Frame;
use rollwalk_sim_host::clock::SimTime;
use rollwalk_sim_host::core::Core;
use rollwalk_sim_host::rig::Rig;
use std::cell::{RefCell, RefMut};
use std::rc::Rc;

/// Rig with several owners.
pub struct SharedRig<C>(Rc<RefCell<Rig<C>>>);

impl<C> Clone for SharedRig<C> {
    fn clone(&self) -> Self {
        Self(Rc::clone(&self.0))
    }
}

impl<C: Core> SharedRig<C> {
    pub fn new(rig: Rig<C>) -> Self {
        Self(Rc::new(RefCell::new(rig)))
    }

    pub fn borrow(&self) -> RefMut<'_, Rig<C>> {
        self.0.borrow_mut()
    }

    pub fn now(&self) -> SimTime {
        self.borrow().now()
    }

    /// Advances time without a host. Frames to the host are lost.
    pub fn abandon_until(&self, until: SimTime) {
        let mut rig = self.borrow();
        rig.run_until(until);
        let now_us = rig.now_us();
        while matches!(rig.receive(now_us), Ok(Some(_))) {}
    }
}

impl<C: Core> LinkBus for SharedRig<C> {
    fn now_us(&self) -> u64 {
        self.borrow().now_us()
    }

    fn send(&mut self, frame: &Frame) -> Result<(), LinkError> {
        self.borrow().send(frame)
    }

    fn receive(&mut self, deadline_us: u64) -> Result<Option<Frame>, LinkError> {
        self.borrow().receive(deadline_us)
    }
}
