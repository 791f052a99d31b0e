//! Actuators and their buses, as far as words about faults depend on them: a serial line has no termination, CAN has no adapter
//! that servos share.
//!
//! Controllers report a fault as a code, a channel and a number of a bus. The host knows the robot, so it names the cause that
//! this kind of bus has.

use rollwalk_protocol::actuator::ActuatorStatus;
use rollwalk_protocol::actuators::bus::{Buses, Protocol};
use rollwalk_protocol::config::RobotConfig;
use rollwalk_protocol::faults::{Event, Fault, FaultBits};
use serde::{Deserialize, Serialize};

/// Kind of an actuator bus.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum BusKind {
    /// CAN.
    Can,
    /// Serial line that servos share and answer on: Dynamixel, Feetech.
    ServoLine,
    /// Serial line to a board that sends pulses to hobby servos: Maestro.
    PulseBoard,
}

/// An actuator bus.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct ActuatorBus {
    /// Kind.
    pub kind: BusKind,
    /// Protocol of the actuators, for people.
    pub protocol: String,
    /// Bits per second.
    pub bit_rate: u32,
}

/// Address and model of a channel's actuator.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct ActuatorOf {
    /// Number of its bus.
    pub bus: u8,
    /// Address on that bus.
    pub id: u8,
    /// Model, as the robot file has it.
    pub model: String,
}

/// Buses and actuators of a robot; empty for a robot that is not known.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Actuators {
    /// Buses by number.
    pub buses: Vec<ActuatorBus>,
    /// Actuators by channel.
    pub channels: Vec<ActuatorOf>,
}

impl Actuators {
    /// Actuators of a robot; `models` by channel.
    pub fn new<'a>(
        config: &RobotConfig,
        buses: &Buses,
        models: impl IntoIterator<Item = &'a str>,
    ) -> Self {
        let channels = config.channels.iter().zip(models).map(|(channel, model)| ActuatorOf {
            bus: channel.bus,
            id: channel.id,
            model: model.to_owned(),
        });
        let last = config.channels.iter().map(|channel| usize::from(channel.bus) + 1).max();
        let buses = (0..last.unwrap_or(0).max(buses.len())).map(|number| {
            let bus = buses.get(number).copied().unwrap_or_default();
            let kind = match bus.protocol {
                Protocol::Maestro(_) => BusKind::PulseBoard,
                protocol if protocol.is_serial() => BusKind::ServoLine,
                _ => BusKind::Can,
            };
            let protocol = bus.protocol.name().to_owned();
            ActuatorBus { kind, protocol, bit_rate: bus.bit_rate }
        });
        Self { buses: buses.collect(), channels: channels.collect() }
    }

    /// Bus of a channel, with its number.
    pub fn bus_of(&self, channel: u8) -> Option<(u8, &ActuatorBus)> {
        let number = self.channels.get(usize::from(channel))?.bus;
        Some((number, self.buses.get(usize::from(number))?))
    }

    /// Channels on a bus.
    pub fn on_bus(&self, bus: u8) -> impl Iterator<Item = u8> {
        (0..).zip(&self.channels).filter(move |(_, of)| of.bus == bus).map(|(channel, _)| channel)
    }

    /// Kind of all buses that have actuators; `None` for a robot with several kinds, or one that is not known.
    pub fn kind(&self) -> Option<BusKind> {
        let mut kinds = self.channels.iter().filter_map(|of| self.buses.get(usize::from(of.bus)));
        let first = kinds.next()?.kind;
        kinds.all(|bus| bus.kind == first).then_some(first)
    }

    /// Kind of the bus that a report of a fault is about, or else of all buses.
    pub fn kind_for(
        &self,
        fault: Fault,
        channel: Option<u8>,
        value: Option<f32>,
    ) -> Option<BusKind> {
        let about_bus = matches!(fault, Fault::BusNoAck | Fault::BusPassive | Fault::BusOff);
        let number = value.filter(|_| about_bus).map(|value| value as usize);
        let of_bus = number.and_then(|number| self.buses.get(number)).map(|bus| bus.kind);
        let of_channel = channel.and_then(|channel| self.bus_of(channel)).map(|(_, bus)| bus.kind);
        of_bus.or(of_channel).or_else(|| self.kind())
    }

    /// Limits of a channel's servo, if its data sheet is known.
    pub fn limits(&self, channel: u8) -> Option<ServoLimits> {
        limits(&self.channels.get(usize::from(channel))?.model)
    }
}

/// Name of a fault and first step against it, for a kind of bus.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct FaultWords {
    /// Short description.
    pub name: &'static str,
    /// First step.
    pub advice: &'static str,
}

/// Words for a fault on a kind of bus, or on one that is not known.
pub fn fault_words(fault: Fault, kind: Option<BusKind>) -> FaultWords {
    let of_any = fault.description();
    let (name, advice) = match (kind, fault) {
        (Some(BusKind::Can), Fault::BusNoAck) => (
            "no drive acknowledges on a CAN bus",
            "check motor power, the cable to the first drive and the bit rate; clear, then arm",
        ),
        (Some(BusKind::Can), Fault::BusPassive) => (
            "a CAN bus is error-passive",
            "check termination (60 Ω between CAN_H and CAN_L) and bit rates; clear, then arm",
        ),
        (Some(BusKind::Can), Fault::BusOff) => (
            "a CAN bus is off",
            "motor power off, look for a short between CAN_H and CAN_L; clear, then arm",
        ),
        (Some(BusKind::ServoLine), Fault::BusOff) => (
            "the serial adapter of the servos is gone",
            "plug the adapter in again, end other programs that use it; clear, then arm",
        ),
        (Some(BusKind::PulseBoard), Fault::BusOff) => (
            "the serial line to the servo board is gone",
            "plug the servo board in again, end other programs that use it; clear, then arm",
        ),
        (Some(BusKind::ServoLine), Fault::BusNoAck | Fault::BusPassive) => (
            "the serial line of the servos is disturbed",
            "check adapter, data wire and baud rate; clear, then arm",
        ),
        (Some(BusKind::PulseBoard), Fault::BusNoAck | Fault::BusPassive) => (
            "the serial line to the servo board is disturbed",
            "check cable, ground and baud rate; clear, then arm",
        ),
        (Some(BusKind::ServoLine), Fault::ActuatorSilent) => (
            "a servo does not answer",
            "check the servo supply, this servo's plug, its ID and its baud rate; clear, then arm",
        ),
        (Some(BusKind::PulseBoard), Fault::ActuatorSilent) => (
            "the servo board does not answer",
            "check the board's supply, its cable, device number and baud rate; clear, then arm",
        ),
        (Some(BusKind::ServoLine), Fault::ActuatorFault) => (
            "a servo reports a fault, or its torque went off",
            "check the supply voltage under load, let it cool; switch servos off and on, clear, then arm",
        ),
        (None, Fault::BusOff) => (
            "an actuator bus is lost",
            "motor power off, look at the bus and its adapter; clear, then arm",
        ),
        _ => (of_any.name, of_any.advice),
    };
    FaultWords { name, advice }
}

/// Names of faults for the buses of a robot, separated by commas; `no fault` for an empty set.
pub fn fault_names_on(faults: FaultBits, actuators: &Actuators) -> String {
    let names = faults.iter().map(|fault| fault_words(fault, actuators.kind()).name);
    let names: Vec<_> = names.collect();
    if names.is_empty() { "no fault".to_owned() } else { names.join(", ") }
}

/// Clause for an event on a kind of bus; `None` where [`Event::description`] fits every kind.
pub fn event_words(event: Event, kind: Option<BusKind>) -> Option<&'static str> {
    Some(match (kind?, event) {
        (BusKind::Can, Event::BusOff) => "a CAN bus went off",
        (BusKind::ServoLine, Event::BusOff) => "the serial adapter of the servos was lost",
        (BusKind::PulseBoard, Event::BusOff) => "the serial line to the servo board was lost",
        (BusKind::ServoLine, Event::FeedbackLost) => "a servo did not answer",
        (BusKind::PulseBoard, Event::FeedbackLost) => "the servo board did not answer",
        (BusKind::ServoLine, Event::ActuatorFault) => {
            "a servo reported a fault, or its torque went off"
        }
        (BusKind::ServoLine, Event::NotAcknowledged | Event::BusPassive) => {
            "the serial line of the servos was disturbed"
        }
        (BusKind::PulseBoard, Event::NotAcknowledged | Event::BusPassive) => {
            "the serial line to the servo board was disturbed"
        }
        _ => return None,
    })
}

/// Limits of a servo, from its data sheet.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ServoLimits {
    /// Least supply voltage, V.
    pub min_v: f32,
    /// Greatest supply voltage, V.
    pub max_v: f32,
    /// Highest temperature, °C.
    pub max_c: u8,
}

/// Limits of a model, by the beginning of its name; `-T` and `-R` are connectors.
fn limits(model: &str) -> Option<ServoLimits> {
    let sheet = |min_v, max_v, max_c| ServoLimits { min_v, max_v, max_c };
    // ROBOTIS e-manual, specifications and default temperature limits.
    let sheets = [
        ("XL330", sheet(3.7, 6.0, 70)),
        ("XL430", sheet(6.5, 12.0, 72)),
        ("XM430", sheet(10.0, 14.8, 80)),
        ("XM540", sheet(10.0, 14.8, 80)),
        ("XH430-W", sheet(10.0, 14.8, 80)),
        ("XH540-W", sheet(10.0, 14.8, 80)),
    ];
    sheets.into_iter().find(|(name, _)| model.starts_with(name)).map(|(_, limits)| limits)
}

/// Conditions in the status of an actuator, in words; empty for one that is well. `limits` name the range that was left.
pub fn conditions(status: ActuatorStatus, limits: Option<ServoLimits>) -> Vec<String> {
    let overheated = limits.map_or_else(
        || "too hot, torque is off".to_owned(),
        |limits| format!("hotter than {} °C, torque is off", limits.max_c),
    );
    let bad_voltage = limits.map_or_else(
        || "supply voltage out of range, torque is off".to_owned(),
        |ServoLimits { min_v, max_v, .. }| {
            format!("supply voltage outside {min_v} to {max_v} V, torque is off")
        },
    );
    let words = [
        (ActuatorStatus::OVERHEATED, overheated),
        (ActuatorStatus::BAD_VOLTAGE, bad_voltage),
        (ActuatorStatus::HARDWARE, "hardware error, torque is off".to_owned()),
        (
            ActuatorStatus::TIMED_OUT,
            "its watchdog switched torque off: no setpoint came".to_owned(),
        ),
        (ActuatorStatus::TORQUE_LIMITED, "at its torque limit".to_owned()),
        (ActuatorStatus::POSITION_LIMITED, "at a position limit of its own".to_owned()),
        (ActuatorStatus::UNANSWERED, "did not answer".to_owned()),
    ];
    words.into_iter().filter(|(bit, _)| status.0 & bit != 0).map(|(_, words)| words).collect()
}

/// Faults of an actuator that its status before did not have, in words.
pub fn new_faults(
    before: Option<ActuatorStatus>,
    now: ActuatorStatus,
    limits: Option<ServoLimits>,
) -> Vec<String> {
    let known = before.map_or(0, |before| before.0);
    conditions(ActuatorStatus(now.0 & ActuatorStatus::FAULTS & !known), limits)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Words that belong to CAN alone.
    const OF_CAN: [&str; 7] =
        ["CAN", "terminat", "candump", "bus is off", "acknowledge", "error-passive", "Ω"];

    #[test]
    fn a_serial_line_is_described_without_words_of_can() {
        for kind in [BusKind::ServoLine, BusKind::PulseBoard] {
            for &fault in Fault::ALL {
                let FaultWords { name, advice } = fault_words(fault, Some(kind));
                for word in OF_CAN {
                    assert!(!name.contains(word) && !advice.contains(word), "{name}: {advice}");
                }
            }
            for &event in Event::ALL {
                let words = event_words(event, Some(kind)).unwrap_or(event.description());
                let of_bus = event == Event::NotAcknowledged || event == Event::BusPassive;
                if kind == BusKind::ServoLine || !of_bus {
                    assert!(!OF_CAN.iter().any(|word| words.contains(word)), "{words}");
                }
            }
        }
        let gone = fault_words(Fault::BusOff, Some(BusKind::ServoLine));
        assert_eq!(gone.name, "the serial adapter of the servos is gone");
        assert!(gone.advice.starts_with("plug the adapter in again"), "{}", gone.advice);
        let off = fault_words(Fault::BusOff, Some(BusKind::Can));
        assert!(off.name.contains("CAN bus") && off.advice.contains("CAN_H"), "{off:?}");
    }

    /// A host that does not know the robot blames neither kind of bus.
    #[test]
    fn a_lost_bus_of_an_unknown_robot_is_named_neutrally() {
        let FaultWords { name, advice } = fault_words(Fault::BusOff, None);
        assert_eq!(name, "an actuator bus is lost");
        assert!(advice.contains("adapter") && !advice.contains("CAN"), "{advice}");
    }

    #[test]
    fn the_bus_of_a_report_decides_on_its_words() {
        let bus = |kind| ActuatorBus { kind, protocol: "x".into(), bit_rate: 1_000_000 };
        let of = |bus| ActuatorOf { bus, id: 1, model: "XL330-M288-T".into() };
        let mixed = Actuators {
            buses: vec![bus(BusKind::Can), bus(BusKind::ServoLine)],
            channels: vec![of(0), of(1)],
        };
        assert_eq!(mixed.kind(), None);
        assert_eq!(mixed.kind_for(Fault::BusOff, None, Some(1.0)), Some(BusKind::ServoLine));
        assert_eq!(mixed.kind_for(Fault::BusOff, None, Some(0.0)), Some(BusKind::Can));
        let silent = Fault::ActuatorSilent;
        assert_eq!(mixed.kind_for(silent, Some(1), Some(0.1)), Some(BusKind::ServoLine));
        assert_eq!(mixed.kind_for(silent, None, None), None);
        let one = Actuators { buses: mixed.buses.clone(), channels: vec![of(1)] };
        assert_eq!(one.kind(), Some(BusKind::ServoLine));
        assert_eq!(Actuators::default().kind(), None);
    }

    #[test]
    fn conditions_name_the_limits_of_the_data_sheet() {
        let status = ActuatorStatus(ActuatorStatus::OVERHEATED | ActuatorStatus::BAD_VOLTAGE);
        let of_pup = conditions(status, limits("XL330-M288-T"));
        assert_eq!(
            of_pup,
            [
                "hotter than 70 °C, torque is off",
                "supply voltage outside 3.7 to 6 V, torque is off"
            ]
        );
        let unknown = conditions(status, limits("micro servo"));
        assert_eq!(
            unknown,
            ["too hot, torque is off", "supply voltage out of range, torque is off"]
        );
        assert!(conditions(ActuatorStatus(ActuatorStatus::ENABLED), None).is_empty());
    }

    /// A monitor warns once, and not of a servo that is at its torque limit as it may be.
    #[test]
    fn a_fault_is_new_once() {
        let hot = ActuatorStatus(ActuatorStatus::OVERHEATED | ActuatorStatus::TORQUE_LIMITED);
        assert_eq!(new_faults(None, hot, None), ["too hot, torque is off"]);
        assert!(new_faults(Some(hot), hot, None).is_empty());
        assert_eq!(new_faults(Some(ActuatorStatus(1)), hot, None).len(), 1);
    }
}
