//! Rules of actuator buses: ranges of settings, and of channels' limits in the protocol's frames.

use super::{Check, Item};
use crate::channel::{Channel, servo_range};
use rollwalk_protocol::actuator::MAX_ID;
use rollwalk_protocol::actuators::Refusal;
use rollwalk_protocol::actuators::bus::{Bus, ControlLoop, Pose, Protocol};
use rollwalk_protocol::actuators::settings::Report;
use rollwalk_protocol::text::Limit;
use std::fmt::Arguments;

/// Torque of 1 kg·cm, N·m.
const NM_PER_KG_CM: f64 = 0.098_066_5;

/// Bit rates of CAN that adapters and drives have.
const CAN_BIT_RATES: [u32; 5] = [125_000, 250_000, 500_000, 800_000, 1_000_000];

impl Check<'_> {
    pub(super) fn buses(&mut self) {
        let robot = self.robot;
        for (&number, bus) in &robot.buses {
            self.at(Item::Bus(number), format!("bus {number}"));
            // A motor on a bus that the controller does not have is reported at the motor.
            if !robot.channels().any(|channel| channel.actuator().bus == number) {
                let help = "put a joint, a wheel or a limb on this bus, or leave out the table";
                self.violated("number", "is a bus without motors", help);
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
                let help =
                    "give 300 to 10000000 bit/s: the bit rate, not the servos' code for this rate";
                self.violated("bit_rate", format_args!("is {}", bus.bit_rate), help);
            } else if let rates = bus.protocol.bit_rates()
                && !rates.is_empty()
                && !rates.contains(&bus.bit_rate)
            {
                let rates: Vec<_> = rates.iter().map(ToString::to_string).collect();
                let help = format!("give one of {} bit/s", rates.join(", "));
                let problem =
                    format_args!("is {}, a rate that {name} servos do not have", bus.bit_rate);
                self.violated("bit_rate", problem, help);
            }
        } else if !CAN_BIT_RATES.contains(&bus.bit_rate) {
            let rates = CAN_BIT_RATES.map(|rate| rate.to_string()).join(", ");
            let help = format!("give a bit rate of CAN: {rates} bit/s");
            self.violated("bit_rate", format_args!("is {}", bus.bit_rate), help);
        }
        if bus.control == ControlLoop::OnController && !can.torque_alone {
            let help = "leave out `control`: the drives close the loop";
            let problem = format!("is \"on_controller\", but {name} has no torque command");
            self.violated("control", problem, help);
        }
        if bus.pose == Pose::AssumedSafe && can.measures_position {
            let help = "leave out `pose`: the drives measure their positions";
            self.violated(
                "pose",
                format!("is \"assumed_safe\", but {name} reports its position"),
                help,
            );
        }
        bus.protocol.check_settings(self);
    }

    /// Checks limits, gains and address of a channel against the ranges of its bus's protocol. Requires numbers and a bus that
    /// break no other rule.
    pub(super) fn protocol_ranges(&mut self, channel: &Channel<'_>) {
        let config = channel.config(self.robot);
        let bus = self.robot.buses.get(&config.bus).copied().unwrap_or_default();
        let Err(refusal) = bus.can_drive(&config) else { return };
        let drive = format!("{} on bus {}", bus.protocol.name(), config.bus);
        let motor = channel.actuator();
        let (field, value, unit) = match refusal {
            Refusal::Address => ("id", f64::from(config.id), ""),
            Refusal::OutOfRange("position") => {
                // Values of the file, not rounded to the controller's numbers.
                let (min, max) = match channel {
                    Channel::Joint(joint) => servo_range(joint, self.robot).into(),
                    Channel::Wheel(..) => (config.min.into(), config.max.into()),
                };
                let widest = min.abs() > max.abs();
                let (field, value) =
                    if widest { ("position_min_rad", min) } else { ("position_max_rad", max) };
                (field, value, " rad")
            }
            Refusal::OutOfRange("speed") => ("speed_max_rad_s", motor.speed_max_rad_s, " rad/s"),
            Refusal::OutOfRange("kp") => ("kp_nm_rad", motor.kp_nm_rad, " N·m/rad"),
            Refusal::OutOfRange("kd") => ("kd_nm_s_rad", motor.kd_nm_s_rad, " N·m·s/rad"),
            Refusal::OutOfRange("torque") => ("torque_max_nm", motor.torque_max_nm, " N·m"),
            Refusal::OutOfRange(_) if matches!(channel, Channel::Joint(of) if of.is_coupled()) => {
                let help = format!(
                    "{drive} cannot command this range: narrow the limits of the joints, or lower the ratios"
                );
                let is_linked = matches!(channel, Channel::Joint(of) if of.linkage.is_some());
                let field = if is_linked { "linkage" } else { "motor_per_joint" };
                let problem = format_args!(
                    "gives the motor a range of {:.3} to {:.3} rad",
                    config.min, config.max
                );
                self.violated(field, problem, help);
                return;
            }
            Refusal::OutOfRange(_) | Refusal::Unsupported(_) | Refusal::Missing(_) => {
                let help =
                    format!("put the motor on a bus with another protocol ({drive}: {refusal})");
                self.violated("bus", "cannot drive this motor", help);
                return;
            }
        };
        let problem = format!("is {value}{unit}, beyond the range of {drive}");
        let mut help = range_of(&bus.protocol, refusal);
        if field == "torque_max_nm" {
            // Makers of servos give torques in kg·cm.
            help += &format!("; {value} kg·cm would be {:.2} N·m", value * NM_PER_KG_CM);
        }
        self.violated(field, problem, help);
    }
}

impl Report for Check<'_> {
    fn violated(&mut self, key: &'static str, problem: Arguments<'_>, help: Arguments<'_>) {
        Check::violated(self, key, problem, help.to_string());
    }
}

/// Range of the quantity that a protocol refused.
fn range_of(protocol: &Protocol, refused: Refusal) -> String {
    let can = protocol.capabilities();
    let Refusal::OutOfRange(quantity) = refused else {
        return format!("addresses are 0 to {}", can.max_id.min(MAX_ID));
    };
    let mut range = match quantity {
        "kp" => format!("at most {} N·m/rad", Limit::AtMost(can.max_gains.kp_nm_rad)),
        "kd" => format!("at most {} N·m·s/rad", Limit::AtMost(can.max_gains.kd_nm_s_rad)),
        _ => "less".to_owned(),
    };
    protocol.explain_range(quantity, &mut |text| range = text.to_string());
    range
}
