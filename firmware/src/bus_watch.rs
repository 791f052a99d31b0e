//! Error states of the actuator buses, as their CAN controllers report them to [`crate::Controller::on_bus_state`].
//!
//! A CAN controller counts errors. Unacknowledged frames, the symptom of missing motor power, make it error-passive but never
//! bus-off. Errors on the line make it bus-off. It must then stay off, because automatic recovery would send a stale set-point
//! as soon as the short circuit is gone. Only the operator's two-step clear restarts it, through [`BusWatch::take_restart`].

use rollwalk_protocol::faults::{Event, Fault, FaultBits};
use rollwalk_protocol::serial::BusState;

use crate::bus::MAX_BUSES;
use crate::safety::EventSet;

/// Number of ticks without acknowledgement that count as a fault. Adapters cause shorter interruptions.
const NO_ACK_TICKS: u8 = 3;

#[derive(Clone, Copy, Debug, Default)]
struct WatchedBus {
    state: BusState,
    /// Number of ticks since the last change of the state.
    ticks: u8,
    restart: bool,
}

impl WatchedBus {
    fn event(&self) -> Option<Event> {
        match self.state {
            BusState::Active => None,
            BusState::NotAcknowledged if self.ticks < NO_ACK_TICKS => None,
            BusState::NotAcknowledged => Some(Event::NotAcknowledged),
            BusState::Passive => Some(Event::BusPassive),
            BusState::Off => Some(Event::BusOff),
        }
    }

    fn fault(&self) -> Option<Fault> {
        self.event()?.fault()
    }
}

#[derive(Clone, Debug, Default)]
pub(crate) struct BusWatch([WatchedBus; MAX_BUSES]);

impl BusWatch {
    /// Records the state of a bus; returns true if it changed. Ignores unknown bus numbers.
    pub fn observe(&mut self, bus: u8, state: BusState) -> bool {
        match self.0.get_mut(usize::from(bus)) {
            Some(bus) if bus.state != state => {
                *bus = WatchedBus { state, ticks: 0, restart: bus.restart };
                true
            }
            _ => false,
        }
    }

    /// Advances by one control period.
    pub fn age(&mut self) {
        for bus in &mut self.0 {
            bus.ticks = bus.ticks.saturating_add(1);
        }
    }

    /// Raises the events of bus faults while torque is on.
    pub fn watch(&self, events: &mut EventSet) {
        self.0.iter().filter_map(WatchedBus::event).for_each(|event| events.insert(event));
    }

    /// Faults that prevent arming.
    pub fn faults(&self) -> FaultBits {
        self.0.iter().filter_map(WatchedBus::fault).fold(FaultBits::default(), FaultBits::with)
    }

    /// Number of the bus with a fault.
    pub fn about(&self, fault: Fault) -> Option<u8> {
        let number = self.0.iter().position(|bus| bus.fault() == Some(fault))?;
        u8::try_from(number).ok()
    }

    /// Permits buses that are off to restart, after the operator's clear.
    pub fn allow_restart(&mut self) {
        for bus in &mut self.0 {
            bus.restart = bus.state == BusState::Off;
        }
    }

    /// Returns true if a bus must be restarted, once for each permission.
    pub fn take_restart(&mut self, bus: u8) -> bool {
        match self.0.get_mut(usize::from(bus)) {
            Some(bus) if bus.restart => {
                *bus = WatchedBus::default();
                true
            }
            _ => false,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_hiccup_is_no_power_failure() {
        let mut buses = BusWatch::default();
        buses.observe(1, BusState::NotAcknowledged);
        for _ in 0..NO_ACK_TICKS {
            assert!(buses.faults().is_empty());
            buses.age();
        }
        assert_eq!(buses.faults(), FaultBits::default().with(Fault::BusNoAck));
        assert_eq!(buses.about(Fault::BusNoAck), Some(1));
        buses.observe(1, BusState::Active);
        assert!(buses.faults().is_empty());
        buses.observe(200, BusState::Off);
        assert!(buses.faults().is_empty());
    }

    #[test]
    fn a_bus_that_is_off_starts_again_only_when_cleared_and_once() {
        let mut buses = BusWatch::default();
        buses.observe(0, BusState::Off);
        assert!(!buses.take_restart(0));
        buses.allow_restart();
        assert!(!buses.take_restart(1));
        assert!(buses.take_restart(0) && !buses.take_restart(0));
        assert!(buses.faults().is_empty());
        // The short circuit persists.
        buses.observe(0, BusState::Off);
        assert!(!buses.take_restart(0));
        let mut events = EventSet::default();
        buses.watch(&mut events);
        assert_eq!(events.pop(), Some(Event::BusOff));
    }
}
