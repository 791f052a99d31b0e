//! Rules of actuator buses: settings within the ranges of their protocol, and limits of channels within
//! the ranges of the protocol's frames.

use super::{Check, Place};
use crate::controller::Channel;
use rollwalk_protocol::actuators::Refusal;
use rollwalk_protocol::actuators::bus::{Bus, ControlLoop, Pose, Protocol};
use rollwalk_protocol::actuators::cybergear::{self, CyberGear};
use rollwalk_protocol::actuators::dynamixel::{Dynamixels, table::VELOCITY_STEP_RAD_S};
use rollwalk_protocol::actuators::maestro::Maestro;
use rollwalk_protocol::actuators::mit::{self, AnswerId, Mit};
use rollwalk_protocol::actuators::odrive::Odrive;
use std::ops::RangeInclusive;

/// Bit rates of CAN that adapters and drives have.
const CAN_BIT_RATES: [u32; 5] = [125_000, 250_000, 500_000, 800_000, 1_000_000];

/// Identifiers of CAN frames, which mini cheetah drives may answer from.
pub(crate) const MASTER_IDS: RangeInclusive<u32> = 0..=0x7FF;
/// Rates of an ODrive's estimates, Hz: periods are whole milliseconds.
pub(crate) const ESTIMATES_HZ: RangeInclusive<u32> = 1..=10_000;
/// Step of a Dynamixel's bus watchdog, ms.
pub(crate) const WATCHDOG_STEP_MS: u32 = 20;
/// Bus watchdog of a Dynamixel, ms: up to 127 steps.
pub(crate) const WATCHDOGS_MS: RangeInclusive<u32> = 0..=127 * WATCHDOG_STEP_MS;
/// Return Delay Time of a Dynamixel, µs: up to 254 steps of 2 µs.
pub(crate) const RETURN_DELAYS_US: RangeInclusive<u32> = 0..=508;
/// Device numbers of a Maestro: 7 bits.
pub(crate) const DEVICES: RangeInclusive<u32> = 0..=127;

impl Check<'_> {
    pub(super) fn buses(&mut self) {
        let robot = self.robot;
        for (&number, bus) in &robot.buses {
            self.at(Place::Bus(number), format!("bus {number}"));
            // A motor on a bus that no controller has is found at the motor.
            if !robot.channels().any(|channel| channel.actuator().bus == number) {
                let help = "give it to a joint, a wheel or a limb, or leave the table out";
                self.violated("number", "is a bus that no motor is on", help);
            }
            self.bus(bus);
        }
    }

    /// Settings of one bus.
    fn bus(&mut self, bus: &Bus) {
        let can = bus.protocol.capabilities();
        let name = bus.protocol.name();
        if bus.protocol.is_serial() {
            if !(300..=10_000_000).contains(&bus.bit_rate) {
                let help = "a serial line has 300 to 10000000 bit/s";
                self.violated("bit_rate", format_args!("is {}", bus.bit_rate), help);
            }
        } else if !CAN_BIT_RATES.contains(&bus.bit_rate) {
            let rates = CAN_BIT_RATES.map(|rate| rate.to_string()).join(", ");
            let help = format!("rates of CAN are {rates} bit/s");
            self.violated("bit_rate", format_args!("is {}", bus.bit_rate), help);
        }
        if bus.control == ControlLoop::OnController && !can.torque_alone {
            let help = "leave it out: the drives close the loop";
            let problem = format!("is \"on_controller\", and no torque can be told to {name}");
            self.violated("control", problem, help);
        }
        if bus.pose == Pose::AssumedSafe && can.measures_position {
            let help = "leave it out: the pose is the one that they measure";
            self.violated("pose", format!("is \"assumed_safe\", and {name} tells its own"), help);
        }
        match bus.protocol {
            Protocol::Rollwalk => {}
            Protocol::Mit(Mit { answers_from, .. }) => {
                if let AnswerId::Master(id) = answers_from {
                    self.whole("master_id", id.into(), MASTER_IDS, "");
                }
            }
            Protocol::Dynamixel(Dynamixels { watchdog_20ms, return_delay_us, .. }) => {
                let watchdog_ms = u32::from(watchdog_20ms) * WATCHDOG_STEP_MS;
                self.whole("watchdog_ms", watchdog_ms, WATCHDOGS_MS, " ms");
                self.whole("return_delay_us", return_delay_us, RETURN_DELAYS_US, " µs");
            }
            Protocol::Odrive(Odrive { reduction, torque_constant_nm_a, estimates_hz, .. }) => {
                self.whole("estimates_hz", estimates_hz, ESTIMATES_HZ, " Hz");
                if !(1e-3..=1e3).contains(&reduction.abs()) {
                    let help = "turns of the motor for one of the joint, 0.001 to 1000; negative \
                                where it turns the other way";
                    self.violated("reduction", format_args!("is {reduction}"), help);
                }
                if !(1e-4..=100.0).contains(&torque_constant_nm_a) {
                    let help = "0.0001 to 100 N·m/A; 8.27 divided by the motor's KV in rpm/V";
                    let problem = format_args!("is {torque_constant_nm_a} N·m/A");
                    self.violated("torque_constant_nm_a", problem, help);
                }
            }
            Protocol::CyberGear(CyberGear { max_position_rad, .. }) => {
                let [sample, table] = [cybergear::SAMPLE_MAX_RAD, cybergear::TABLE_MAX_RAD];
                // A file has no more digits of 4π than its author cared for.
                if ![sample, table].iter().any(|most| (max_position_rad - most).abs() < 1e-3) {
                    let help = "the manual has 12.5 and 12.566 (4π): docs/actuators.md says how \
                                to find out which it is";
                    let problem = format_args!("is {max_position_rad} rad");
                    self.violated("max_position_rad", problem, help);
                }
            }
            Protocol::Maestro(Maestro { device, pulse, .. }) => {
                if let Some(device) = device {
                    self.whole("device", device.into(), DEVICES, "");
                }
                if !(1.0..=10_000.0).contains(&pulse.us_per_rad.abs()) {
                    let help = "µs for each rad, 1 to 10000; negative where it turns the other way";
                    self.violated("us_per_rad", format_args!("is {}", pulse.us_per_rad), help);
                }
                let (least, most) = pulse.limits_us;
                if !(least >= 1.0 && most > least && most <= 4000.0) {
                    let help = "the shortest and the longest pulse, 1 to 4000 µs";
                    self.violated("pulse_us", format_args!("is [{least}, {most}]"), help);
                }
            }
        }
    }

    /// A whole number within the range of a drive's setting.
    fn whole(&mut self, field: &'static str, value: u32, range: RangeInclusive<u32>, unit: &str) {
        if !range.contains(&value) {
            let help = format!("allowed is {} to {}{unit}", range.start(), range.end());
            self.violated(field, format_args!("is {value}{unit}"), help);
        }
    }

    /// Limits, gains and address of a channel within the ranges of its bus's protocol. Assumes that its
    /// numbers and its bus break no other rule.
    pub(super) fn protocol_ranges(&mut self, channel: &Channel<'_>) {
        let config = channel.config();
        let bus = self.robot.buses.get(&config.bus).copied().unwrap_or_default();
        let Err(refusal) = bus.can_drive(&config) else { return };
        let speaker = format!("{} on bus {}", bus.protocol.name(), config.bus);
        let (field, value) = match refusal {
            Refusal::Address => ("id", f64::from(config.id)),
            Refusal::OutOfRange("position") => {
                let widest = config.min.abs() > config.max.abs();
                let (field, value) = if widest {
                    ("position_min_rad", config.min)
                } else {
                    ("position_max_rad", config.max)
                };
                (field, value.into())
            }
            Refusal::OutOfRange("speed") => ("speed_max_rad_s", channel.actuator().speed_max_rad_s),
            Refusal::OutOfRange("kp") => ("kp_nm_rad", channel.actuator().kp_nm_rad),
            Refusal::OutOfRange("kd") => ("kd_nm_s_rad", channel.actuator().kd_nm_s_rad),
            Refusal::OutOfRange("torque") => ("torque_max_nm", channel.actuator().torque_max_nm),
            Refusal::OutOfRange(_) | Refusal::Unsupported(_) | Refusal::Missing(_) => {
                let help = format!("put it on a bus whose actuators can ({speaker}: {refusal})");
                self.violated("bus", "is one that cannot drive it", help);
                return;
            }
        };
        let problem = format!("is {value}, which cannot be told to {speaker}");
        self.violated(field, problem, protocol_limit(&bus.protocol, field));
    }
}

/// Help: the range of a field in a protocol's frames.
fn protocol_limit(protocol: &Protocol, field: &str) -> String {
    let can = protocol.capabilities();
    let upto = |most: f32, unit: &str| format!("at most {most} {unit}");
    match (field, protocol) {
        ("id", _) => format!("addresses are 0 to {}", can.max_id),
        ("kd_nm_s_rad", Protocol::Odrive(_)) => {
            "its kp is a multiple of its kd: give kd above 0".to_owned()
        }
        ("kp_nm_rad", _) => upto(can.max_gains.kp_nm_rad, "N·m/rad"),
        ("kd_nm_s_rad", _) => upto(can.max_gains.kd_nm_s_rad, "N·m·s/rad"),
        ("speed_max_rad_s", Protocol::Mit(p)) => upto(p.model.max_speed_rad_s, "rad/s"),
        ("torque_max_nm", Protocol::Mit(p)) => upto(p.model.max_torque_nm, "N·m"),
        ("speed_max_rad_s", Protocol::CyberGear(_)) => upto(cybergear::MAX_SPEED_RAD_S, "rad/s"),
        ("torque_max_nm", Protocol::CyberGear(_)) => upto(cybergear::MAX_TORQUE_NM, "N·m"),
        ("speed_max_rad_s", Protocol::Dynamixel(p)) => {
            upto(p.model.max_velocity as f32 * VELOCITY_STEP_RAD_S, "rad/s")
        }
        ("torque_max_nm", Protocol::Dynamixel(p)) => upto(p.goal_current_max_nm(), "N·m"),
        (_, Protocol::Mit(_)) => format!("positions are within ±{} rad", mit::MAX_POSITION_RAD),
        (_, Protocol::Maestro(p)) => {
            let (least, most) = p.pulse.limits_us;
            format!("its pulses are {least} to {most} µs: see `centre_us` and `us_per_rad`")
        }
        _ => "less".to_owned(),
    }
}
