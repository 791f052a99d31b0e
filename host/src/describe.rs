//! States, events and faults in words. Facts about faults come from [`rollwalk_protocol::faults`].

use crate::actuators::{Actuators, BusKind, conditions, event_words, fault_names_on, fault_words};
use rollwalk_protocol::actuator::ActuatorStatus;
use rollwalk_protocol::faults::{Event, Fault, FaultBits};
use rollwalk_protocol::wire::{LogEntry, State, Status};

/// Behaviour of a robot that receives no heartbeats.
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

/// Description of a state without its faults; of a robot that a bus has stopped also which bus.
pub fn state_words(status: &Status, actuators: &Actuators) -> String {
    match status.state {
        State::EStopped if !status.faults.contains(Fault::EStop) => condition(status, actuators),
        state => state_name(state).to_owned(),
    }
}

/// Description of a state with its faults, to follow "the robot is". A bus that fails stops the robot as an emergency stop
/// does, and is named as the cause.
pub fn condition(status: &Status, actuators: &Actuators) -> String {
    let Status { state, faults, .. } = *status;
    let names = fault_names_on(faults, actuators);
    match faults.first() {
        None => state_name(state).to_owned(),
        Some(Fault::EStop) if state == State::EStopped && faults.iter().count() == 1 => {
            state_name(state).to_owned()
        }
        Some(_) if state == State::EStopped && !faults.contains(Fault::EStop) => {
            format!("stopped: {names}")
        }
        Some(_) => format!("{}: {names}", state_name(state)),
    }
}

/// Advice to the operator: about the most severe fault, without a fault about the state. `kind` is that of the actuator buses.
pub fn advice(state: State, faults: FaultBits, kind: Option<BusKind>) -> &'static str {
    if let Some(fault) = faults.first() {
        return fault_words(fault, kind).advice;
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
        State::TorqueOff => "wait: it becomes disarmed by itself, then it can be armed",
        State::EStopped => "clear, then arm",
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

/// Description of the event of a log entry, for the buses of a robot.
pub fn entry_sentence(entry: &LogEntry, actuators: &Actuators) -> String {
    let event = Event::from_code(entry.event);
    let kind = entry.fault.map_or_else(
        || actuators.kind(),
        |fault| actuators.kind_for(fault, entry.channel, Some(entry.value)),
    );
    let words = event.and_then(|event| event_words(event, kind));
    words.map_or_else(|| event_sentence(entry.event), str::to_owned)
}

/// Description of a fault, with channel and value of its report if it has them.
pub fn fault_report(fault: Fault, channel: Option<String>, value: Option<f32>) -> String {
    fault_words(fault, None).name.to_owned() + &report_details(fault, channel, value)
}

/// Description of a fault as [`fault_report`] gives it, in the words for the bus that it is about.
pub fn fault_report_on(
    fault: Fault,
    channel: Option<u8>,
    name: Option<String>,
    value: Option<f32>,
    actuators: &Actuators,
) -> String {
    let kind = actuators.kind_for(fault, channel, value);
    fault_words(fault, kind).name.to_owned() + &report_details(fault, name, value)
}

/// Channel and value of a fault report in parentheses; empty without both.
pub fn report_details(fault: Fault, channel: Option<String>, value: Option<f32>) -> String {
    let value = fault.description().value.zip(value);
    let value = value.map(|(quantity, value)| match fault {
        Fault::ActuatorFault => actuator_status(ActuatorStatus(value as u8)),
        _ => quantity.reading(value).to_string(),
    });
    let details: Vec<_> = channel.into_iter().chain(value).collect();
    if details.is_empty() { String::new() } else { format!(" ({})", details.join(", ")) }
}

/// Status byte of an actuator in words.
fn actuator_status(status: ActuatorStatus) -> String {
    if !status.faulty() && !status.enabled() {
        return "torque off without an error of its own: a dip of its supply resets a servo".into();
    }
    let conditions = conditions(status, None);
    if conditions.is_empty() { "torque on, no error".into() } else { conditions.join(", ") }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::actuators::{ActuatorBus, ActuatorOf};

    #[test]
    fn faults_are_named() {
        let faults = FaultBits::default().with(Fault::HostLost).with(Fault::EStop);
        let names = |faults| fault_names_on(faults, &Actuators::default());
        assert_eq!(names(faults), "heartbeat lost, emergency stop");
        assert_eq!(names(FaultBits::default()), "no fault");
    }

    #[test]
    fn the_most_severe_fault_is_attended_to_first() {
        let faults = FaultBits::default().with(Fault::HostLost).with(Fault::EStop);
        assert_eq!(advice(State::EStopped, faults, None), Fault::EStop.description().advice);
        assert_eq!(advice(State::Ready, FaultBits::default(), None), "play a motion");
    }

    /// Torque goes off at the end of every session; without a fault there is nothing to clear.
    #[test]
    fn torque_off_without_a_fault_needs_no_clear() {
        let words = advice(State::TorqueOff, FaultBits::default(), None);
        assert!(!words.contains("clear"), "{words}");
        assert!(advice(State::EStopped, FaultBits::default(), None).starts_with("clear"));
    }

    #[test]
    fn a_lost_bus_is_not_called_an_emergency_stop() {
        let status = |state, faults| Status {
            state,
            severity: state.severity(faults),
            faults,
            clip: None,
            frame: 0,
            counter: 0,
            library: 0,
        };
        let of_pup = Actuators {
            buses: vec![ActuatorBus {
                kind: BusKind::ServoLine,
                protocol: "Dynamixel".into(),
                bit_rate: 1_000_000,
            }],
            channels: vec![ActuatorOf { bus: 0, id: 1, model: "XL330-M288-T".into() }],
        };
        let lost = FaultBits::default().with(Fault::BusOff);
        let words = condition(&status(State::EStopped, lost), &of_pup);
        assert_eq!(words, "stopped: the serial adapter of the servos is gone");
        assert_eq!(state_words(&status(State::EStopped, lost), &of_pup), words);
        let both = status(State::EStopped, lost.with(Fault::EStop));
        assert_eq!(state_words(&both, &of_pup), "stopped by an emergency stop");
        let pressed = status(State::EStopped, FaultBits::default().with(Fault::EStop));
        assert_eq!(condition(&pressed, &of_pup), "stopped by an emergency stop");
        let entry = LogEntry {
            fault: Some(Fault::BusOff),
            event: Event::BusOff.code(),
            at_ms: 0,
            before: State::Playing,
            after: State::EStopped,
            channel: None,
            value: 0.0,
        };
        assert_eq!(entry_sentence(&entry, &of_pup), "the serial adapter of the servos was lost");
    }

    #[test]
    fn values_have_units_and_meanings() {
        let knee = || Some("knee".to_owned());
        for (fault, channel, value, expected) in [
            (Fault::Tilt, None, -1.0, " (the IMU is silent)"),
            (Fault::Tilt, None, 0.5, " (0.500 rad beyond the tilt of its motion)"),
            (Fault::Overrun, None, 0.08, " (0.080 s from one tick to the next)"),
            (
                Fault::ActuatorFault,
                knee(),
                9.0,
                " (knee, its watchdog switched torque off: no setpoint came)",
            ),
            (
                Fault::ActuatorFault,
                knee(),
                0.0,
                " (knee, torque off without an error of its own: a dip of its supply resets a servo)",
            ),
            (Fault::TrackingError, knee(), 0.91, " (knee, 0.910 rad from its setpoint)"),
            (Fault::BusOff, None, 1.0, " (bus 1)"),
            (Fault::EStop, None, 0.0, ""),
        ] {
            assert_eq!(report_details(fault, channel, Some(value)), expected);
        }
        assert_eq!(fault_report(Fault::BusOff, None, None), "an actuator bus is lost");
    }
}
