//! What an operator should do next, in a sentence: by fault, else by state.

use rollwalk_protocol::wire::{Fault, FaultBits, State};

/// What to do about a fault: the first step of its section in `docs/faults.md`.
pub fn about(fault: Fault) -> &'static str {
    match fault {
        Fault::NoLibrary => "flash a library, then arm",
        Fault::ConfigMismatch => "flash a library that was built from this robot's file",
        Fault::HostLost => "see why heartbeats did not arrive; clear, then arm",
        Fault::ActuatorSilent => "check motor power and this actuator's cable; clear, then arm",
        Fault::ActuatorFault => "read the drive's own error, let it cool; clear, then arm",
        Fault::TrackingError => {
            "free what holds the joint; is the torque limit or the gain too low? clear, then arm"
        }
        Fault::OutOfLimits => "turn the joint back into its range by hand, then arm",
        Fault::Tilt => "set the robot up, without torque; clear, then arm",
        Fault::BusNoAck => "check motor power and the actuator bus; clear, then arm",
        Fault::BusPassive => "check termination and bit rates of the actuator bus; clear, then arm",
        Fault::BusOff => "motor power off, mend the bus; clear, then arm",
        Fault::EStop => "see why it was pressed, look at the robot; clear, then arm",
        Fault::Overrun => "see what holds the control loop up; clear, then arm",
        Fault::LibraryUnreadable => "flash the library again; clear, then arm",
        Fault::Internal => "the firmware's configuration is unusable: build it anew",
    }
}

/// The fault that comes first: the most severe, by what it makes the controller do.
pub fn first(faults: FaultBits) -> Option<Fault> {
    const ORDER: [Fault; 15] = [
        Fault::EStop,
        Fault::BusOff,
        Fault::Internal,
        Fault::ActuatorSilent,
        Fault::ActuatorFault,
        Fault::BusNoAck,
        Fault::BusPassive,
        Fault::TrackingError,
        Fault::Tilt,
        Fault::LibraryUnreadable,
        Fault::Overrun,
        Fault::OutOfLimits,
        Fault::HostLost,
        Fault::ConfigMismatch,
        Fault::NoLibrary,
    ];
    ORDER.into_iter().find(|&fault| faults.contains(fault))
}

/// What to do in a state without fault.
pub fn in_state(state: State) -> &'static str {
    match state {
        State::Boot | State::SelfTest => "wait: it tests itself",
        State::Disarmed => "arm: it goes from its pose to SAFE, slowly",
        State::Aligning => "wait: it goes to SAFE",
        State::Ready => "play a motion",
        State::Playing => "play another motion, pause, or return to SAFE",
        State::Paused => "go on, or return to SAFE",
        State::Returning => "wait: it returns to SAFE, then torque goes off",
        State::Damped => "wait: it is let down, then torque goes off",
        State::TorqueOff | State::EStopped => "clear, then arm",
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_fault_comes_first_when_it_is_alone() {
        for &fault in Fault::ALL {
            assert_eq!(first(FaultBits::default().with(fault)), Some(fault));
        }
        let both = FaultBits::default().with(Fault::HostLost).with(Fault::EStop);
        assert_eq!(first(both), Some(Fault::EStop));
        assert_eq!(first(FaultBits::default()), None);
    }
}
