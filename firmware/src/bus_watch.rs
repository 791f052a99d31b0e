//! How the actuator buses are, as their controllers see it: what [`crate::Controller::on_bus_state`] is
//! told.
//!
//! A CAN controller counts errors. A frame that nobody acknowledges makes it error-passive and no more,
//! so motor power that is off looks like that; errors on the line make it go off. It must stay off:
//! with automatic recovery it would send what it was told last as soon as the short is gone. The
//! operator's two-step clear is what starts it again, by way of [`BusWatch::take_restart`].

use rollwalk_protocol::serial::BusState;
use rollwalk_protocol::wire::{Fault, FaultBits};

use crate::bus::MAX_BUSES;
use crate::safety::{Event, EventSet};

/// For so many ticks nobody may acknowledge: an adapter that hiccups is not a power failure.
const NO_ACK_TICKS: u8 = 3;

#[derive(Clone, Copy, Debug, Default)]
struct Bus {
    state: BusState,
    /// Ticks in this state.
    ticks: u8,
    restart: bool,
}

impl Bus {
    fn fault(&self) -> Option<(Fault, Event)> {
        match self.state {
            BusState::Active => None,
            BusState::NotAcknowledged if self.ticks < NO_ACK_TICKS => None,
            BusState::NotAcknowledged => Some((Fault::BusNoAck, Event::NotAcknowledged)),
            BusState::Passive => Some((Fault::BusPassive, Event::BusPassive)),
            BusState::Off => Some((Fault::BusOff, Event::BusOff)),
        }
    }
}

/// All actuator buses.
#[derive(Clone, Debug, Default)]
pub(crate) struct BusWatch([Bus; MAX_BUSES]);

impl BusWatch {
    /// Takes note of how a bus is; whether that is news. Numbers that no bus has are ignored.
    pub fn observe(&mut self, bus: u8, state: BusState) -> bool {
        match self.0.get_mut(usize::from(bus)) {
            Some(bus) if bus.state != state => {
                *bus = Bus { state, ticks: 0, restart: bus.restart };
                true
            }
            _ => false,
        }
    }

    /// A control period has passed.
    pub fn age(&mut self) {
        for bus in &mut self.0 {
            bus.ticks = bus.ticks.saturating_add(1);
        }
    }

    /// Raises what is wrong while torque is on.
    pub fn watch(&self, events: &mut EventSet) {
        self.0.iter().filter_map(Bus::fault).for_each(|(_, event)| events.insert(event));
    }

    /// What stands in the way of torque.
    pub fn faults(&self) -> FaultBits {
        let faults = self.0.iter().filter_map(Bus::fault);
        faults.fold(FaultBits::default(), |all, (fault, _)| all.with(fault))
    }

    /// The number of the bus that a fault is about.
    pub fn about(&self, fault: Fault) -> Option<u8> {
        let is_it = |bus: &Bus| bus.fault().is_some_and(|(f, _)| f == fault);
        u8::try_from(self.0.iter().position(is_it)?).ok()
    }

    /// The operator has cleared: buses that are off may start again.
    pub fn allow_restart(&mut self) {
        for bus in &mut self.0 {
            bus.restart = bus.state == BusState::Off;
        }
    }

    /// Whether a bus is to be started again; once.
    pub fn take_restart(&mut self, bus: u8) -> bool {
        match self.0.get_mut(usize::from(bus)) {
            Some(bus) if bus.restart => {
                *bus = Bus::default();
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
        // It is as short as before.
        buses.observe(0, BusState::Off);
        assert!(!buses.take_restart(0));
        let mut events = EventSet::default();
        buses.watch(&mut events);
        assert_eq!(events.pop(), Some(Event::BusOff));
    }
}
