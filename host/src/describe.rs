//! Descriptions of states, events and faults in sentences. Facts about faults are defined in [`rollwalk_protocol::faults`].

use crate::actuators::{Actuators, BusKind, conditions, event_words, fault_names_on, fault_words};
use rollwalk_protocol::actuator::ActuatorStatus;
use rollwalk_protocol::faults::{Event, Fault, FaultBits, Quantity};
use rollwalk_protocol::wire::{LogEntry, State, Status, Torque};

/// Behaviour of a robot that receives no heartbeats.
pub const LEFT_ALONE: &str = "an armed robot then returns to SAFE automatically, or halts if it was following streamed \
     setpoints";

/// Behaviour of a robot in a state, if its controller runs but no frame of a host arrives. `None` without driven torque.
pub fn alone(state: State) -> Option<&'static str> {
    match (state.torque(), state) {
        (Torque::Off, _) => None,
        (_, State::Streaming) => {
            Some("without setpoints a live controller holds the robot's pose, then lets it sink")
        }
        (_, State::Aligning | State::Damped) => Some("a live controller lets the robot sink"),
        _ => Some(
            "without heartbeats a live controller returns the robot to SAFE, then switches torque \
             off",
        ),
    }
}

/// Description of a robot that an emergency stop has stopped.
const ESTOPPED: &str = "stopped by an emergency stop";

/// True if the robot stays stopped until an operator clears the stop. A robot without torque and without a fault becomes
/// disarmed automatically.
pub fn has_to_be_cleared(status: &Status) -> bool {
    status.state == State::EStopped || status.state == State::TorqueOff && !status.faults.is_empty()
}

/// True if torque is off and no stop has to be cleared.
pub fn is_at_rest(status: &Status) -> bool {
    status.state.torque() == Torque::Off && !has_to_be_cleared(status)
}

/// Description of a state, to follow "the robot is". The state alone does not tell an emergency stop from a failed bus.
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
        State::EStopped => "stopped",
        State::Streaming => "following streamed setpoints",
    }
}

/// Description of a state without its faults, except for the cause of a stop: an emergency stop or a failed bus.
pub fn state_words(status: &Status, actuators: &Actuators) -> String {
    match status.state {
        State::EStopped if status.faults.contains(Fault::EStop) => ESTOPPED.to_owned(),
        State::EStopped => condition(status, actuators),
        state => state_name(state).to_owned(),
    }
}

/// Description of a state with its faults, to follow "the robot is".
///
/// A failed bus stops the robot like an emergency stop, and is named as the cause.
pub fn condition(status: &Status, actuators: &Actuators) -> String {
    let Status { state, faults, .. } = *status;
    let names = fault_names_on(faults, actuators);
    match faults.first() {
        None => state_name(state).to_owned(),
        Some(Fault::EStop) if state == State::EStopped && faults.iter().count() == 1 => {
            ESTOPPED.to_owned()
        }
        Some(_) if state == State::EStopped && faults.contains(Fault::EStop) => {
            format!("{ESTOPPED}: {names}")
        }
        Some(_) => format!("{}: {names}", state_name(state)),
    }
}

/// Advice to the operator about the most severe fault, or about the state if there is no fault. `kind` is the kind of the
/// actuator buses.
pub fn advice(state: State, faults: FaultBits, kind: Option<BusKind>) -> &'static str {
    if let Some(fault) = faults.first() {
        return fault_words(fault, kind).advice;
    }
    match state {
        State::Boot | State::SelfTest => "wait for the end of the self-test",
        State::Disarmed => "arm: the robot then moves slowly from its pose to SAFE",
        State::Aligning => "wait until the robot is at SAFE",
        State::Ready => "play a motion",
        State::Playing => "play another motion, pause, or return to SAFE",
        State::Paused => "resume, or return to SAFE",
        State::Returning => "wait: the robot returns to SAFE or halts, then torque is switched off",
        State::Damped => "wait: the robot sinks down, then torque is switched off",
        State::TorqueOff => "wait until the robot is disarmed automatically, then arm",
        State::EStopped => "clear the stop, then arm",
        State::Streaming => "steer, or return to SAFE",
    }
}

/// Description of the event with this [`Event::code`].
pub fn event_sentence(code: u8) -> String {
    Event::from_code(code).map_or_else(
        || format!("event {code}, which this version of rollwalk does not support"),
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

/// Description of a fault, with the channel and value of its report if present.
pub fn fault_report(fault: Fault, channel: Option<String>, value: Option<f32>) -> String {
    fault_words(fault, None).name.to_owned() + &report_details(fault, channel, value)
}

/// Description of a fault like that of [`fault_report`], adapted to the kind of bus that it concerns.
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

/// Channel and value of a fault report in parentheses; empty if both are absent.
pub fn report_details(fault: Fault, channel: Option<String>, value: Option<f32>) -> String {
    let value = fault.description().value.zip(value);
    let value = value.map(|(quantity, value)| match fault {
        Fault::ActuatorFault => actuator_status(ActuatorStatus(value as u8)),
        _ => match quantity {
            Quantity::MeasuredUnless(..) if value < 0.0 => quantity.reading(value).to_string(),
            Quantity::Measured("rad", what) | Quantity::MeasuredUnless("rad", what, _) => {
                format!("{:.0}° {what}", value.to_degrees())
            }
            _ => quantity.reading(value).to_string(),
        },
    });
    let details: Vec<_> = channel.into_iter().chain(value).collect();
    if details.is_empty() { String::new() } else { format!(" ({})", details.join(", ")) }
}

/// Description of an actuator's status byte.
fn actuator_status(status: ActuatorStatus) -> String {
    if !status.faulty() && !status.enabled() {
        return "torque off without an error: a drop of the supply voltage may have reset the servo".into();
    }
    let conditions = conditions(status, None);
    if conditions.is_empty() { "torque on, no error".into() } else { conditions.join(", ") }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixtures::{servo_line, status};

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

    /// Torque goes off at the end of every session: without a fault there is nothing to clear.
    #[test]
    fn torque_off_without_a_fault_needs_no_clear() {
        let words = advice(State::TorqueOff, FaultBits::default(), None);
        assert!(!words.contains("clear"), "{words}");
        assert!(advice(State::EStopped, FaultBits::default(), None).starts_with("clear"));
    }

    #[test]
    fn a_lost_bus_is_not_called_an_emergency_stop() {
        let of_pup = servo_line([1]);
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
            (Fault::Tilt, None, 0.5, " (29° beyond the tilt of its motion)"),
            (Fault::Overrun, None, 0.08, " (0.080 s from one tick to the next)"),
            (
                Fault::ActuatorFault,
                knee(),
                9.0,
                " (knee, its watchdog switched torque off, because no setpoint arrived)",
            ),
            (
                Fault::ActuatorFault,
                knee(),
                0.0,
                " (knee, torque off without an error: a drop of the supply voltage may have reset the servo)",
            ),
            (Fault::TrackingError, knee(), 0.91, " (knee, 52° from its setpoint)"),
            (Fault::OutOfLimits, knee(), -0.5, " (knee, -29° measured)"),
            (Fault::BusOff, None, 1.0, " (bus 1)"),
            (Fault::EStop, None, 0.0, ""),
        ] {
            assert_eq!(report_details(fault, channel, Some(value)), expected);
        }
        assert_eq!(fault_report(Fault::BusOff, None, None), "an actuator bus is lost");
    }
}
