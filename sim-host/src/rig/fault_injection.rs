//! Fault injection on the bench. It starts and ends faults, lets foreign nodes send, and reports the state of the actuator
//! buses to the controller as an adapter would. [`crate::faults`] defines the faults.

use super::{Core, Interface, LinkError, Rig, SimTime};
use crate::bus::{NodeId, TxPolicy};
use crate::faults::{Fault, FaultKind};
use crate::wire::{ActuatorBus, ActuatorLine};
use rollwalk_firmware::BusState;
use rollwalk_protocol::can::Frame;

/// Transmit queue depth of a foreign node, frames: one in transmission and the next one, so that there is no gap.
const BABBLE_DEPTH: usize = 2;

/// Time until a sender without acknowledgement is error-passive. It sends the frame 16 times, each up to 135 bits and an error
/// frame of up to 31 bits, at 1 Mbit/s.
const PASSIVE_AFTER: SimTime = SimTime::from_us(16 * (135 + 31));

/// Adapter between the controller and its actuator buses.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Adapter {
    /// Depth of the transmit buffer, frames.
    pub depth: usize,
    /// True if frames that are unacknowledged at the next control period are aborted, as on the boards of this project.
    pub calls_back: bool,
    /// Bus state that is reported while no node acknowledges. Some adapters do not distinguish this from other errors.
    pub alone: BusState,
}

impl Default for Adapter {
    /// Adapter like the CAN controllers on this project's boards, except that it keeps an unacknowledged frame.
    fn default() -> Self {
        Self { depth: 1, calls_back: false, alone: BusState::NotAcknowledged }
    }
}

/// Foreign node that sends at a fixed interval.
pub struct Babbler {
    node: NodeId,
    bus: Interface,
    frame: Frame,
    every: SimTime,
    pub next: SimTime,
    pub until: SimTime,
}

impl<C: Core> Rig<C> {
    /// Adds a fault, which starts after the present time at the earliest.
    pub fn add_fault(&mut self, fault: Fault) {
        let from = fault.from.max(self.now + SimTime::from_ns(1));
        let fault = Fault { from, ..fault };
        if let FaultKind::Babble(bus, frame, every) = fault.kind {
            let node = self.wire(bus).bus.add_node(TxPolicy::Queue { depth: BABBLE_DEPTH });
            let (next, until) = (fault.from, fault.until);
            self.babblers.push(Babbler { node, bus, frame, every, next, until });
        }
        self.faults.add(fault);
    }

    /// Reports the states of the actuator buses to the controller, and restarts the buses whose restart the controller requests.
    pub(super) fn report_bus_states(&mut self) -> Result<(), LinkError> {
        if self.faults.all().next().is_none() {
            return Ok(());
        }
        let (now, adapter) = (self.now, self.adapter);
        let link = &self.link;
        let waits = [link.controller, self.host].iter().any(|&node| link.bus.pending(node) > 0);
        if link.alone_since.is_some() && waits {
            self.faults.fire(now, |kind| *kind == FaultKind::NoAck(Interface::Link));
        }
        for (&number, ActuatorBus { wire, servos, .. }) in &mut self.actuator_buses {
            let mut state = if wire.off { BusState::Off } else { BusState::Active };
            if let Some(since) = wire.alone_since
                && wire.bus.pending(wire.controller) > 0
                && !wire.off
            {
                self.faults.fire(now, |kind| match kind {
                    FaultKind::NoAck(bus) => *bus == Interface::Actuator(number),
                    _ => servos.iter().any(|&(_, channel)| kind.silences(channel)),
                });
                if now - since >= PASSIVE_AFTER {
                    state = adapter.alone;
                }
                if adapter.calls_back {
                    wire.bus.cancel(wire.controller);
                }
            }
            self.controller.on_bus_state(now.as_us(), number, state)?;
            if wire.off && self.controller.take_bus_restart(number)? {
                let short = self.faults.on(now).any(|kind| *kind == FaultKind::BusOff(number));
                wire.off = short;
                if short {
                    self.faults.fire(now, |kind| *kind == FaultKind::BusOff(number));
                    self.controller.on_bus_state(now.as_us(), number, BusState::Off)?;
                }
            }
        }
        Ok(())
    }

    /// Starts and ends the faults that are due.
    pub(super) fn begin_and_end_faults(&mut self) {
        let (now, before) = (self.now, self.edges_until);
        self.edges_until = now;
        let began: Vec<FaultKind> = (self.faults.all())
            .filter(|(fault, _)| before < fault.from && fault.from <= now)
            .map(|(fault, _)| fault.kind)
            .collect();
        let on: Vec<FaultKind> = self.faults.on(now).copied().collect();
        for (&number, ActuatorBus { wire, servos, .. }) in &mut self.actuator_buses {
            let silent = |channel| on.iter().any(|kind| kind.silences(channel));
            for &(node, channel) in servos.iter().filter(|(_, channel)| silent(*channel)) {
                wire.bus.cancel(node);
                if began.contains(&FaultKind::Unpowered(channel)) {
                    self.body.cut_power(channel);
                    self.faults.fire(now, |kind| *kind == FaultKind::Unpowered(channel));
                }
            }
            let listens = servos.iter().any(|&(_, channel)| !silent(channel));
            wire.connect(
                now,
                listens && !on.contains(&FaultKind::NoAck(Interface::Actuator(number))),
            );
            if began.contains(&FaultKind::BusOff(number)) {
                wire.go_off(now);
                self.faults.fire(now, |kind| *kind == FaultKind::BusOff(number));
                if let Some(observer) = &mut self.observer {
                    observer.on_bus_off(now);
                }
                // An error is ignored: the report is repeated in every control period, and its error returned there.
                let _ = self.controller.on_bus_state(now.as_us(), number, BusState::Off);
            }
        }
        for (&number, ActuatorLine { line, channels, is_cut, .. }) in &mut self.lines {
            for &channel in channels.iter() {
                if on.iter().any(|kind| kind.silences(channel)) {
                    line.silence(channel);
                }
                if began.contains(&FaultKind::Unpowered(channel)) {
                    self.body.cut_power(channel);
                    self.faults.fire(now, |kind| *kind == FaultKind::Unpowered(channel));
                }
            }
            let cut = FaultKind::NoAck(Interface::Actuator(number));
            *is_cut = on.contains(&cut);
            if began.contains(&cut) {
                self.faults.fire(now, |kind| *kind == cut);
            }
        }
        self.link.connect(now, !on.contains(&FaultKind::NoAck(Interface::Link)));
    }

    /// Makes a babbling node send its next frame.
    pub(super) fn babble(&mut self, index: usize) {
        let now = self.now;
        let &Babbler { node, bus, frame, every, .. } = &self.babblers[index];
        self.babblers[index].next = now + every;
        let wire = self.wire(bus);
        if wire.bus.pending(node) < BABBLE_DEPTH {
            wire.bus.post(now, node, frame).expect("there is room");
            self.faults.fire(now, |kind| *kind == FaultKind::Babble(bus, frame, every));
        }
    }
}
