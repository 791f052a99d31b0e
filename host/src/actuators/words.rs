//! Descriptions of faults and events in the terms of a kind of bus.

use super::{Actuators, BusKind};
use rollwalk_protocol::faults::{Event, Fault, FaultBits};

/// Name of a fault and the first step of its repair, in the terms of a kind of bus.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct FaultWords {
    /// Short description.
    pub name: &'static str,
    /// First step against the fault.
    pub advice: &'static str,
}

/// Name of a fault, first step of its repair, and text for its event. The text is `None` if the general text fits every kind of
/// bus.
type Row = (&'static str, &'static str, Option<&'static str>);

/// Description of a fault on a kind of bus; `None` if the description of [`Fault::description`] fits.
fn row(kind: Option<BusKind>, fault: Fault) -> Option<Row> {
    use BusKind::{Can, PulseBoard, ServoLine};
    Some(match (kind, fault) {
        (Some(Can), Fault::BusNoAck) => (
            "no drive acknowledges on a CAN bus",
            "check motor power, the cable to the first drive and the bit rate; clear the fault, then arm",
            None,
        ),
        (Some(Can), Fault::BusPassive) => (
            "a CAN bus is error-passive",
            "check termination (60 Ω between CAN_H and CAN_L) and bit rates; clear the fault, then arm",
            None,
        ),
        (Some(Can), Fault::BusOff) => (
            "a CAN bus is off",
            "switch motor power off and check for a short between CAN_H and CAN_L; clear the fault, then arm",
            Some("a CAN bus went off"),
        ),
        (Some(ServoLine), Fault::BusOff) => (
            "the serial adapter of the servos is gone",
            "switch motor power off, plug the adapter in again and end other programs that use it; clear the \
             fault, then arm",
            Some("the serial adapter of the servos was lost"),
        ),
        (Some(PulseBoard), Fault::BusOff) => (
            "the serial line to the servo board is gone",
            "switch motor power off, plug the servo board in again and end other programs that use it; clear \
             the fault, then arm",
            Some("the serial line to the servo board was lost"),
        ),
        (Some(ServoLine), Fault::BusNoAck | Fault::BusPassive) => (
            "the serial line of the servos is disturbed",
            "check adapter, data wire and baud rate; clear the fault, then arm",
            Some("the serial line of the servos was disturbed"),
        ),
        (Some(PulseBoard), Fault::BusNoAck | Fault::BusPassive) => (
            "the serial line to the servo board is disturbed",
            "check cable, ground and baud rate; clear the fault, then arm",
            Some("the serial line to the servo board was disturbed"),
        ),
        (Some(ServoLine), Fault::ActuatorSilent) => (
            "a servo does not answer",
            "check the servo supply; with power off, check this servo's plug; check its ID and baud rate; \
             clear the fault, then arm",
            Some("a servo did not answer"),
        ),
        (Some(PulseBoard), Fault::ActuatorSilent) => (
            "the servo board does not answer",
            "check the board's supply, its cable, device number and baud rate; clear the fault, then arm",
            Some("the servo board did not answer"),
        ),
        (Some(ServoLine), Fault::ActuatorFault) => (
            "a servo reports a fault, or its torque went off",
            "check the supply voltage under load and let the servo cool; switch servos off and on, \
             clear the fault, then arm",
            Some("a servo reported a fault, or its torque went off"),
        ),
        (_, Fault::SetpointTimeout) => (
            "streamed setpoints arrived too late",
            "read why drive or control ended, or find out what delays the host or the link; clear \
             the fault, then arm",
            None,
        ),
        (None, Fault::BusOff) => (
            "an actuator bus is lost",
            "switch motor power off, check the bus and its adapter; clear the fault, then arm",
            None,
        ),
        _ => return None,
    })
}

/// Describes a fault on a kind of bus; `None` stands for an unknown kind.
pub fn fault_words(fault: Fault, kind: Option<BusKind>) -> FaultWords {
    let of_any = fault.description();
    let (name, advice, _) = row(kind, fault).unwrap_or((of_any.name, of_any.advice, None));
    FaultWords { name, advice }
}

/// Names of faults on the buses of a robot, separated by commas; `no fault` for an empty set.
pub fn fault_names_on(faults: FaultBits, actuators: &Actuators) -> String {
    let names = faults.iter().map(|fault| fault_words(fault, actuators.kind()).name);
    let names: Vec<_> = names.collect();
    if names.is_empty() { "no fault".to_owned() } else { names.join(", ") }
}

/// Text for an event in the terms of a kind of bus; `None` if [`Event::description`] fits every kind.
pub fn event_words(event: Event, kind: Option<BusKind>) -> Option<&'static str> {
    let (_, _, clause) = row(kind, event.fault()?)?;
    clause
}
