//! States, events and faults in words. Facts about faults come from [`rollwalk_protocol::faults`].

use rollwalk_protocol::faults::{Event, Fault, FaultBits};
use rollwalk_protocol::wire::State;

/// What a robot does that gets no heartbeats.
pub const LEFT_ALONE: &str =
    "an armed robot returns to SAFE by itself, or halts if it is streamed to";

/// Description of a state, to follow "the robot is".
pub fn state_name(state: State) -> &'static str {
    match state {
        State::Boot => "starting",
        State::SelfTest => "testing itself",
        State::Disarmed => "disarmed",
        State::Aligning => "aligning",
        State::Ready => "ready",
        State::Playing => "playing",
        State::Paused => "paused",
        State::Returning => "returning to SAFE",
        State::Damped => "damped",
        State::TorqueOff => "stopped, torque off",
        State::EStopped => "stopped by an emergency stop",
        State::Streaming => "following streamed setpoints",
    }
}

/// Advice to the operator: about the most severe fault, without a fault about the state.
pub fn advice(state: State, faults: FaultBits) -> &'static str {
    if let Some(fault) = faults.first() {
        return fault.description().advice;
    }
    match state {
        State::Boot | State::SelfTest => "wait: it tests itself",
        State::Disarmed => "arm: it goes from its pose to SAFE, slowly",
        State::Aligning => "wait: it goes to SAFE",
        State::Ready => "play a motion",
        State::Playing => "play another motion, pause, or return to SAFE",
        State::Paused => "go on, or return to SAFE",
        State::Returning => "wait: it returns to SAFE, or halts, then torque goes off",
        State::Damped => "wait: it is let down, then torque goes off",
        State::TorqueOff | State::EStopped => "clear, then arm",
        State::Streaming => "steer, or return to SAFE",
    }
}

/// Description of the event with this [`Event::code`].
pub fn event_sentence(code: u8) -> String {
    Event::from_code(code).map_or_else(
        || format!("something that this host does not know (event {code})"),
        |event| event.description().to_owned(),
    )
}

/// Faults by name, separated by commas; `no fault` for an empty set.
pub fn fault_names(faults: FaultBits) -> String {
    let names: Vec<_> = faults.iter().map(|fault| fault.description().name).collect();
    if names.is_empty() { "no fault".to_owned() } else { names.join(", ") }
}

/// Description of a fault, with channel and value of its report if it has them.
pub fn fault_report(fault: Fault, channel: Option<String>, value: Option<f32>) -> String {
    fault.description().name.to_owned() + &report_details(fault, channel, value)
}

/// Channel and value of a fault report in parentheses; empty without both.
pub fn report_details(fault: Fault, channel: Option<String>, value: Option<f32>) -> String {
    let value = fault.description().value.zip(value);
    let value = value.map(|(quantity, value)| quantity.reading(value).to_string());
    let details: Vec<_> = channel.into_iter().chain(value).collect();
    if details.is_empty() { String::new() } else { format!(" ({})", details.join(", ")) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn faults_are_named() {
        let faults = FaultBits::default().with(Fault::HostLost).with(Fault::EStop);
        assert_eq!(fault_names(faults), "heartbeat lost, emergency stop");
        assert_eq!(fault_names(FaultBits::default()), "no fault");
    }

    #[test]
    fn the_most_severe_fault_is_attended_to_first() {
        let faults = FaultBits::default().with(Fault::HostLost).with(Fault::EStop);
        assert_eq!(advice(State::EStopped, faults), Fault::EStop.description().advice);
        assert_eq!(advice(State::Ready, FaultBits::default()), "play a motion");
    }

    #[test]
    fn values_have_units_and_meanings() {
        let knee = || Some("knee".to_owned());
        for (fault, channel, value, expected) in [
            (Fault::Tilt, None, -1.0, " (the IMU is silent)"),
            (Fault::Tilt, None, 0.5, " (0.500 rad beyond the tilt of its motion)"),
            (Fault::Overrun, None, 0.08, " (0.080 s from one tick to the next)"),
            (Fault::ActuatorFault, knee(), 9.0, " (knee, status byte 0x09)"),
            (Fault::TrackingError, knee(), 0.91, " (knee, 0.910 rad from its setpoint)"),
            (Fault::BusOff, None, 1.0, " (bus 1)"),
            (Fault::EStop, None, 0.0, ""),
        ] {
            assert_eq!(report_details(fault, channel, Some(value)), expected);
        }
        assert_eq!(fault_report(Fault::BusOff, None, None), "a bus is off");
    }
}
