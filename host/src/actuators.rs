//! Actuators and buses of a robot, which determine how faults are described.
//!
//! Controllers report a fault as a code, a channel and a bus number. The host has the description of the robot's buses, so it
//! names a cause that this kind of bus can have. A serial line, for example, has no termination, and CAN has no adapter that
//! servos share.

mod readings;
mod words;

pub use readings::{ReadingWarning, reading_words};
pub use words::{FaultWords, event_words, fault_names_on, fault_words};

use rollwalk_protocol::actuator::ActuatorStatus;
use rollwalk_protocol::actuators::bus::{Buses, Protocol};
use rollwalk_protocol::config::RobotConfig;
use rollwalk_protocol::faults::Fault;
use serde::{Deserialize, Serialize};

/// Actuators of an unknown robot.
pub static UNKNOWN: Actuators = Actuators { buses: Vec::new(), channels: Vec::new() };

/// Kind of an actuator bus.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum BusKind {
    /// CAN.
    Can,
    /// Serial line that servos share for commands and answers: Dynamixel, Feetech.
    ServoLine,
    /// Serial line to a board that sends pulses to hobby servos: Maestro.
    PulseBoard,
}

/// Actuator bus.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct ActuatorBus {
    /// Kind.
    pub kind: BusKind,
    /// Name of the actuators' protocol, for display.
    pub protocol: String,
    /// Bit rate, bit/s.
    pub bit_rate: u32,
}

/// Address and model of a channel's actuator.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct ChannelActuator {
    /// Bus number of the actuator.
    pub bus: u8,
    /// Address on the bus.
    pub id: u8,
    /// Model, as written in the robot file.
    pub model: String,
}

/// Buses and actuators of a robot; empty if the robot is unknown.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Actuators {
    /// Buses, indexed by bus number.
    pub buses: Vec<ActuatorBus>,
    /// Actuators, indexed by channel.
    pub channels: Vec<ChannelActuator>,
}

impl Actuators {
    /// Creates the description from the configuration of a robot. `models` are the actuators' models, one for each channel.
    pub fn new(
        config: &RobotConfig,
        buses: &Buses,
        models: impl IntoIterator<Item = String>,
    ) -> Self {
        let channels = config.channels.iter().zip(models).map(|(channel, model)| ChannelActuator {
            bus: channel.bus,
            id: channel.id,
            model,
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

    /// Number and description of the bus of a channel.
    pub fn bus_of(&self, channel: u8) -> Option<(u8, &ActuatorBus)> {
        let number = self.channels.get(usize::from(channel))?.bus;
        Some((number, self.buses.get(usize::from(number))?))
    }

    /// Channels on a bus.
    pub fn on_bus(&self, bus: u8) -> impl Iterator<Item = u8> {
        (0..).zip(&self.channels).filter(move |(_, of)| of.bus == bus).map(|(channel, _)| channel)
    }

    /// Common kind of all buses that have actuators; `None` if the kinds differ or the robot is unknown.
    pub fn kind(&self) -> Option<BusKind> {
        let mut kinds = self.channels.iter().filter_map(|of| self.buses.get(usize::from(of.bus)));
        let first = kinds.next()?.kind;
        kinds.all(|bus| bus.kind == first).then_some(first)
    }

    /// Kind of the bus that a fault report concerns, or otherwise the common kind of all buses.
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

    /// Silent servo that keeps `channel` from answering on its serial line; `None` if there is none.
    ///
    /// The servos of a line answer in the order of their channels, each after the end of the answer before. A silent servo
    /// therefore silences all servos after it.
    pub fn waits_for(&self, channel: u8, is_silent: impl Fn(u8) -> bool) -> Option<u8> {
        let (number, bus) = self.bus_of(channel)?;
        if bus.kind != BusKind::ServoLine {
            return None;
        }
        let line: Vec<u8> = self.on_bus(number).collect();
        let after = line.iter().rposition(|&other| !is_silent(other)).map_or(0, |last| last + 1);
        line.get(after).copied().filter(|&first| first < channel)
    }

    /// Limits of a channel's servo; `None` if its data sheet is unknown.
    pub fn limits(&self, channel: u8) -> Option<ServoLimits> {
        limits(&self.channels.get(usize::from(channel))?.model)
    }
}

/// Limits of a servo, from its data sheet.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ServoLimits {
    /// Lowest supply voltage, V.
    pub min_v: f32,
    /// Highest supply voltage, V.
    pub max_v: f32,
    /// Highest temperature, °C.
    pub max_c: u8,
}

/// Limits of a model, found by the beginning of its name. The suffixes `-T` and `-R` denote connectors.
fn limits(model: &str) -> Option<ServoLimits> {
    let sheet = |min_v, max_v, max_c| ServoLimits { min_v, max_v, max_c };
    // Source: ROBOTIS e-manual, specifications and default temperature limits.
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

/// Describes the conditions in the status of an actuator; empty if it has none. `limits` name the range that was left.
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
            "its watchdog switched torque off, because no setpoint arrived".to_owned(),
        ),
        (ActuatorStatus::TORQUE_LIMITED, "at its torque limit".to_owned()),
        (ActuatorStatus::POSITION_LIMITED, "at its own position limit".to_owned()),
        (ActuatorStatus::UNANSWERED, "did not answer".to_owned()),
    ];
    words.into_iter().filter(|(bit, _)| status.0 & bit != 0).map(|(_, words)| words).collect()
}

/// Describes the faults of an actuator that its previous status did not have.
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
    use rollwalk_protocol::faults::Event;

    /// Terms that only apply to CAN.
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
        assert!(
            gone.advice.starts_with("switch motor power off, plug the adapter in again"),
            "{}",
            gone.advice
        );
        let off = fault_words(Fault::BusOff, Some(BusKind::Can));
        assert!(off.name.contains("CAN bus") && off.advice.contains("CAN_H"), "{off:?}");
    }

    /// Description of a fault names no kind of bus if the robot is unknown.
    #[test]
    fn a_lost_bus_of_an_unknown_robot_is_named_neutrally() {
        let FaultWords { name, advice } = fault_words(Fault::BusOff, None);
        assert_eq!(name, "an actuator bus is lost");
        assert!(advice.contains("adapter") && !advice.contains("CAN"), "{advice}");
    }

    #[test]
    fn the_bus_of_a_report_decides_on_its_words() {
        let bus = |kind| ActuatorBus { kind, protocol: "x".into(), bit_rate: 1_000_000 };
        let of = |bus| ChannelActuator { bus, id: 1, model: "XL330-M288-T".into() };
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
    fn servos_after_a_silent_one_wait_for_its_answer() {
        let bus = |kind| ActuatorBus { kind, protocol: "x".into(), bit_rate: 1_000_000 };
        let of = |bus| ChannelActuator { bus, id: 1, model: "XL330-M288-T".into() };
        let robot = Actuators {
            buses: vec![bus(BusKind::Can), bus(BusKind::ServoLine)],
            channels: vec![of(0), of(1), of(1), of(1), of(1)],
        };
        let waits = |silent: &'static [u8]| -> Vec<_> {
            (0..5).map(|channel| robot.waits_for(channel, |of| silent.contains(&of))).collect()
        };
        assert_eq!(waits(&[2, 3, 4]), [None, None, None, Some(2), Some(2)]);
        assert_eq!(waits(&[4]), [None; 5]);
        // If a later servo answers, a silent servo is itself the cause.
        assert_eq!(waits(&[2]), [None; 5]);
        assert_eq!(waits(&[1, 3, 4]), [None, None, None, None, Some(3)]);
        assert_eq!(waits(&[0, 1, 2, 3, 4]), [None, None, Some(1), Some(1), Some(1)]);
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

    /// A monitor warns once of a fault, and does not warn of a servo at its torque limit.
    #[test]
    fn a_fault_is_new_once() {
        let hot = ActuatorStatus(ActuatorStatus::OVERHEATED | ActuatorStatus::TORQUE_LIMITED);
        assert_eq!(new_faults(None, hot, None), ["too hot, torque is off"]);
        assert!(new_faults(Some(hot), hot, None).is_empty());
        assert_eq!(new_faults(Some(ActuatorStatus(1)), hot, None).len(), 1);
    }
}
