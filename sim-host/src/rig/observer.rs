//! Hooks of a [`super::Rig`] for a monitor: every frame at the controller's border, and every step of the motors.

use crate::body::Body;
use crate::clock::SimTime;
use crate::interface::Interface;
use rollwalk_protocol::can::Frame;
use rollwalk_protocol::tunnel::Input;
use std::cell::RefCell;
use std::rc::Rc;

/// Receives what happens in a [`super::Rig`], in the order in which it happens, and influences nothing.
pub trait Observer {
    /// The host has put a frame into its interface.
    fn host_sends(&mut self, at: SimTime, frame: &Frame);

    /// The controller receives a frame or a tick.
    fn controller_gets(&mut self, at: SimTime, input: &Input);

    /// A frame leaves the controller for a bus; what waits in the bus's interface has left it before.
    fn controller_sends(&mut self, at: SimTime, bus: Interface, frame: &Frame, body: &Body);

    /// An actuator bus of the controller goes bus-off.
    fn bus_goes_off(&mut self, at: SimTime);

    /// The motors have made a step.
    fn motors(&mut self, at: SimTime, body: &Body);
}

/// An observer that its owner reads while the rig runs.
impl<O: Observer> Observer for Rc<RefCell<O>> {
    fn host_sends(&mut self, at: SimTime, frame: &Frame) {
        self.borrow_mut().host_sends(at, frame);
    }

    fn controller_gets(&mut self, at: SimTime, input: &Input) {
        self.borrow_mut().controller_gets(at, input);
    }

    fn controller_sends(&mut self, at: SimTime, bus: Interface, frame: &Frame, body: &Body) {
        self.borrow_mut().controller_sends(at, bus, frame, body);
    }

    fn bus_goes_off(&mut self, at: SimTime) {
        self.borrow_mut().bus_goes_off(at);
    }

    fn motors(&mut self, at: SimTime, body: &Body) {
        self.borrow_mut().motors(at, body);
    }
}
