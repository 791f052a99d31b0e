//! Hooks of a [`super::Rig`] for a monitor: frames of host and controller, bus-off, and every step of the motors.

use crate::body::Body;
use crate::clock::SimTime;
use crate::interface::Interface;
use rollwalk_protocol::can::Frame;
use rollwalk_protocol::tunnel::Input;
use std::cell::RefCell;
use std::rc::Rc;

/// Receives the events of a [`super::Rig`] in their order, without influence on them. The default methods ignore them.
pub trait Observer {
    /// Called when the host has put a frame into its interface.
    fn on_host_frame(&mut self, _at: SimTime, _frame: &Frame) {}

    /// Called when the controller receives a frame or a tick.
    fn on_controller_input(&mut self, _at: SimTime, _input: &Input) {}

    /// Called when a frame leaves the controller for a bus. Frames that wait in the bus's interface have left earlier.
    fn on_controller_frame(&mut self, _at: SimTime, _bus: Interface, _frame: &Frame, _body: &Body) {
    }

    /// Called when the controller goes bus-off at an actuator bus.
    fn on_bus_off(&mut self, _at: SimTime) {}

    /// Called when the motors have made a step.
    fn on_motor_step(&mut self, _at: SimTime, _body: &Body) {}
}

/// Observer that ignores all events.
impl Observer for () {}

/// Pair of observers; the first one receives each event first.
impl<A: Observer, B: Observer> Observer for (A, B) {
    fn on_host_frame(&mut self, at: SimTime, frame: &Frame) {
        self.0.on_host_frame(at, frame);
        self.1.on_host_frame(at, frame);
    }

    fn on_controller_input(&mut self, at: SimTime, input: &Input) {
        self.0.on_controller_input(at, input);
        self.1.on_controller_input(at, input);
    }

    fn on_controller_frame(&mut self, at: SimTime, bus: Interface, frame: &Frame, body: &Body) {
        self.0.on_controller_frame(at, bus, frame, body);
        self.1.on_controller_frame(at, bus, frame, body);
    }

    fn on_bus_off(&mut self, at: SimTime) {
        self.0.on_bus_off(at);
        self.1.on_bus_off(at);
    }

    fn on_motor_step(&mut self, at: SimTime, body: &Body) {
        self.0.on_motor_step(at, body);
        self.1.on_motor_step(at, body);
    }
}

/// Observer that its owner can read while the rig runs.
impl<O: Observer> Observer for Rc<RefCell<O>> {
    fn on_host_frame(&mut self, at: SimTime, frame: &Frame) {
        self.borrow_mut().on_host_frame(at, frame);
    }

    fn on_controller_input(&mut self, at: SimTime, input: &Input) {
        self.borrow_mut().on_controller_input(at, input);
    }

    fn on_controller_frame(&mut self, at: SimTime, bus: Interface, frame: &Frame, body: &Body) {
        self.borrow_mut().on_controller_frame(at, bus, frame, body);
    }

    fn on_bus_off(&mut self, at: SimTime) {
        self.borrow_mut().on_bus_off(at);
    }

    fn on_motor_step(&mut self, at: SimTime, body: &Body) {
        self.borrow_mut().on_motor_step(at, body);
    }
}
