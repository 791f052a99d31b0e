//! Delivery of frames that have crossed a bus: to the host, the servos, the log, or the controller.

use super::{Core, Interface, LogEntry, Rig, SimTime};
use crate::faults::FramePath;
use crate::wire::ActuatorBus;
use rollwalk_protocol::can::Frame;
use rollwalk_protocol::tunnel::Input;

impl<C: Core> Rig<C> {
    /// Sends the unsolicited frames of drives that are due by `now`.
    pub(super) fn send_timed_frames(&mut self, now: SimTime) {
        while let Some((channel, frame)) = self.body.on_timer(now) {
            if self.faults.on(now).any(|kind| kind.silences(channel)) {
                self.faults.fire(now, |kind| kind.silences(channel));
                continue;
            }
            let (bus, _) = self.body.addresses()[channel];
            if let Some(actuators) = self.actuator_buses.get_mut(&bus)
                && let Some(node) = actuators.node_of(channel)
            {
                let posted = actuators.wire.bus.post(now, node, frame);
                posted.expect("a `Latest` node always takes frames");
            }
        }
    }

    /// Completes a frame on the link. Returns the controller's input, if any.
    pub(super) fn end_link_frame(&mut self) -> Option<Input> {
        let delivery = self.link.bus.next_delivery(self.now)?;
        self.log.push(LogEntry {
            at_us: delivery.at.as_us(),
            interface: Interface::Link,
            frame: delivery.frame,
        });
        if delivery.from == self.host {
            return self.pass_on(FramePath::LinkToController, delivery.frame);
        }
        self.pass_on(FramePath::LinkToHost, delivery.frame);
        // A foreign node's frame reaches both the host and the controller.
        let foreign = delivery.from != self.link.controller;
        foreign.then(|| self.pass_on(FramePath::LinkToController, delivery.frame))?
    }

    /// Completes a frame on an actuator bus. Returns the controller's input, if any.
    pub(super) fn end_actuator_frame(&mut self, number: u8) -> Option<Input> {
        let ActuatorBus { wire, servos, .. } = self.actuator_buses.get_mut(&number)?;
        let delivery = wire.bus.next_delivery(self.now)?;
        let frame = delivery.frame;
        let interface = Interface::Actuator(number);
        self.log.push(LogEntry { at_us: delivery.at.as_us(), interface, frame });
        let from_controller = delivery.from == wire.controller;
        let from_servo = servos.iter().any(|&(node, _)| node == delivery.from);
        // A controller that is bus-off receives nothing.
        let receives = !from_controller && !wire.off;
        if !from_servo {
            self.pass_on(FramePath::ToActuators(number), frame);
        }
        receives.then(|| self.pass_on(FramePath::FromActuators(number), frame))?
    }

    /// Applies stream faults to a frame that has crossed its bus. Returns the controller's input, if any.
    fn pass_on(&mut self, path: FramePath, frame: Frame) -> Option<Input> {
        let frame = self.faults.push(self.now, path, frame)?;
        self.arrive(path, &frame)
    }

    /// Delivers a frame. Returns the controller's input, if any.
    pub(super) fn arrive(&mut self, path: FramePath, frame: &Frame) -> Option<Input> {
        match path {
            // No node on the link accepts 29-bit identifiers.
            FramePath::LinkToController | FramePath::LinkToHost
                if frame.standard_id().is_none() =>
            {
                None
            }
            FramePath::LinkToController => Some(Input::Link(*frame)),
            FramePath::FromActuators(bus) => Some(Input::Actuator(bus, *frame)),
            FramePath::LinkToHost => {
                self.host_inbox.push_back(*frame);
                None
            }
            FramePath::ToActuators(bus) => {
                self.reach_servos(bus, frame);
                None
            }
        }
    }

    fn reach_servos(&mut self, bus: u8, frame: &Frame) {
        let now = self.now;
        let Some(ActuatorBus { wire, servos, .. }) = self.actuator_buses.get_mut(&bus) else {
            return;
        };
        for &(node, channel) in servos.iter() {
            if let Some(value) = self.body.commanded(channel, frame) {
                self.recorder.on_setpoint(channel, value);
            }
            if self.faults.on(now).any(|kind| kind.silences(channel)) {
                self.faults.fire(now, |kind| kind.silences(channel));
            } else if let Some(answer) = self.body.on_frame(channel, now, frame) {
                wire.bus.post(now, node, answer).expect("a `Latest` node always takes frames");
            }
        }
    }
}
