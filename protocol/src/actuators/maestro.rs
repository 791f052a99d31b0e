//! Hobby servos behind a Pololu Maestro.
//!
//! Document: "Pololu Maestro Servo Controller User's Guide", sections 5.c to 5.e. The highest bit is set in command bytes and
//! clear in data bytes, so values have 14 bits, low 7 first. A target is a pulse length in quarters of a microsecond. Target 0
//! stops the pulses, the only way to switch torque off.
//!
//! The servos measure nothing: a servo that is switched on moves to its first target as fast as it can.

use core::fmt::Arguments;
use core::ops::RangeInclusive;

use serde::{Deserialize, Serialize};

use super::fixed::nearest;
use super::serial::{Answer, ReceiveBuffer};
use super::settings::{Keys, Report, check_integer, or};
use super::traffic::polled;
use super::{
    ActuatorCommand, Answers, Capabilities, Codec, Command, Faults, Feedback, Packet, Refusal,
    SerialCodec, Traffic, UpdatePolicy, Watchdog, without, without_torque,
};
use crate::packet::append;

/// Pulses of a servo.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Pulse {
    /// Pulse length at 0 rad, µs.
    pub centre_us: f32,
    /// Change of the pulse length with the angle, µs/rad; negative if the servo turns the other way.
    pub us_per_rad: f32,
    /// Shortest and longest pulse, µs.
    pub limits_us: (f32, f32),
}

impl Default for Pulse {
    fn default() -> Self {
        USUAL_PULSE
    }
}

/// Pulses of most servos: 1 to 2 ms for 90°. The Maestro itself clips pulses to its settings.
const USUAL_PULSE: Pulse = Pulse {
    centre_us: 1500.0,
    us_per_rad: 1000.0 / core::f32::consts::FRAC_PI_2,
    limits_us: (992.0, 2000.0),
};

/// Settings of a Maestro on a line.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Maestro {
    /// Device number of the Pololu protocol, in which devices can share a line; `None` for the compact protocol.
    pub device: Option<u8>,
    /// True to append a CRC-7 to every command. Must match "Enable CRC" in the settings of the Maestro.
    pub crc: bool,
    /// True if the board supports "Set Multiple Targets"; all boards but the Micro Maestro do.
    pub set_multiple: bool,
    /// Pulses of the servos.
    pub pulse: Pulse,
}

/// Largest channel number of the largest Maestro.
pub const MAX_CHANNEL: u8 = 23;
/// Range of device numbers, 7 bits.
const DEVICES: RangeInclusive<u32> = 0..=127;

const SET_TARGET: u8 = 0x84;
const SET_SPEED: u8 = 0x87;
const SET_ACCELERATION: u8 = 0x89;
const SET_MULTIPLE: u8 = 0x9F;
const GET_ERRORS: u8 = 0xA1;
const GO_HOME: u8 = 0xA2;

/// Error bits of a Maestro: 0 to 4 for damaged or invalid commands, 5 for the serial timeout, 6 to 8 for its script.
const ERRORS: [(u32, Faults); 2] = [(0x1F, Faults::REFUSED), (1 << 5, Faults::TIMED_OUT)];

/// CRC-7 with the polynomial x⁷ + x³ + 1, least significant bit first.
pub fn crc7(bytes: &[u8]) -> u8 {
    bytes.iter().fold(0, |crc, byte| {
        (0..8)
            .fold(crc ^ byte, |crc: u8, _| if crc & 1 != 0 { (crc ^ 0x91) >> 1 } else { crc >> 1 })
    })
}

/// Encodes a 14-bit value in two bytes, low 7 bits first.
fn two(value: u16) -> [u8; 2] {
    [(value & 0x7F) as u8, (value >> 7 & 0x7F) as u8]
}

impl Maestro {
    /// Builds a command with its data. Excess data is dropped; the longest command has 54 bytes.
    fn command(&self, command: u8, data: &[u8]) -> Packet {
        let mut packet = Packet::new();
        let _ = match self.device {
            Some(device) => append(&mut packet, &[0xAA, device & 0x7F, command & 0x7F]),
            None => append(&mut packet, &[command]),
        };
        let _ = append(&mut packet, data);
        if self.crc {
            let crc = crc7(&packet);
            let _ = packet.push(crc);
        }
        packet
    }

    /// Sets the target of a channel, quarters of a microsecond; 0 stops its pulses.
    pub fn set_target(&self, channel: u8, quarters_us: u16) -> Packet {
        let [low, high] = two(quarters_us);
        self.command(SET_TARGET, &[channel & 0x7F, low, high])
    }

    /// Sets the targets of up to 24 consecutive channels, quarters of a microsecond.
    pub fn set_targets(&self, first: u8, quarters_us: &[u16]) -> Packet {
        let mut data = heapless::Vec::<u8, 50>::new();
        let count = quarters_us.len().min(24);
        let _ = append(&mut data, &[count as u8, first & 0x7F]);
        for target in quarters_us.iter().take(24) {
            let _ = append(&mut data, &two(*target));
        }
        self.command(SET_MULTIPLE, &data)
    }

    /// Sets the speed limit of a channel, in 0.25 µs per 10 ms; 0 for no limit.
    pub fn set_speed(&self, channel: u8, speed: u16) -> Packet {
        let [low, high] = two(speed);
        self.command(SET_SPEED, &[channel & 0x7F, low, high])
    }

    /// Sets the acceleration limit of a channel, 0 to 255, in 0.25 µs per 10 ms per 80 ms; 0 for no limit.
    pub fn set_acceleration(&self, channel: u8, acceleration: u8) -> Packet {
        let [low, high] = two(u16::from(acceleration));
        self.command(SET_ACCELERATION, &[channel & 0x7F, low, high])
    }

    /// Requests the error bits and clears them. The answer has two bytes.
    pub fn get_errors(&self) -> Packet {
        self.command(GET_ERRORS, &[])
    }

    /// Moves all servos to the home positions in the settings, which may be "off".
    pub fn go_home(&self) -> Packet {
        self.command(GO_HOME, &[])
    }

    /// Decodes the errors in the answer to [`Self::get_errors`].
    pub fn errors(answer: [u8; 2]) -> Feedback {
        let faults = Faults::translate(u32::from(u16::from_le_bytes(answer)), &ERRORS);
        Feedback { faults: Some(faults), ..Feedback::default() }
    }

    /// Target for an angle, quarters of a microsecond.
    pub fn target(&self, position_rad: f32) -> Result<u16, Refusal> {
        let us = self.pulse.centre_us + position_rad * self.pulse.us_per_rad;
        let (least, most) = self.pulse.limits_us;
        let target = nearest(us * 4.0, 1, 0x3FFF).filter(|_| us >= least && us <= most);
        target.map(|target| target as u16).ok_or(Refusal::OutOfRange("position"))
    }
}

const EXAMPLE: Maestro = Maestro {
    device: None,
    crc: false,
    set_multiple: true,
    pulse: Pulse { limits_us: (500.0, 2500.0), ..USUAL_PULSE },
};

impl Codec for Maestro {
    type Sent = Packet;

    const EXAMPLES: &'static [Self] = &[EXAMPLE, Self { crc: true, ..EXAMPLE }];

    fn name(&self) -> &'static str {
        "Maestro"
    }

    fn capabilities(&self) -> Capabilities {
        Capabilities {
            joints: true,
            wheels: false,
            gains: UpdatePolicy::Never,
            max_gains: super::Gains { kp_nm_rad: f32::MAX, kd_nm_s_rad: f32::MAX },
            limits: UpdatePolicy::Never,
            joint_speed: false,
            torque: false,
            torque_alone: false,
            exact_zero_speed: false,
            answers: Answers::OnQuery,
            measures_position: false,
            measures_torque: false,
            query: true,
            query_readings: false,
            reports_enabled: false,
            pose_while_disabled: false,
            watchdog: Watchdog::GoesHome,
            max_id: MAX_CHANNEL,
        }
    }

    fn emit(&self, order: &ActuatorCommand, send: &mut dyn FnMut(Packet)) -> Result<(), Refusal> {
        let channel = order.id;
        super::address(channel, MAX_CHANNEL)?;
        let packet = match order.command {
            Command::Disable => self.set_target(channel, 0),
            Command::EnableJoint { measured_rad } => {
                self.set_target(channel, self.target(measured_rad)?)
            }
            Command::Joint(joint) => {
                without(joint.gains, "gains")?;
                without_torque(joint.torque_nm)?;
                self.set_target(channel, self.target(joint.position_rad)?)
            }
            Command::Query | Command::ClearFaults => self.get_errors(),
            Command::QueryReadings => return Err(Refusal::Unsupported("readings")),
            Command::EnableWheel | Command::Wheel(_) => {
                return Err(Refusal::Unsupported("wheel speed"));
            }
            Command::EnableTorque | Command::Torque { .. } => {
                return Err(Refusal::Unsupported("torque"));
            }
            Command::Gains(_) => return Err(Refusal::Unsupported("gains")),
            Command::Limits { .. } => return Err(Refusal::Unsupported("limits")),
        };
        send(packet);
        Ok(())
    }

    /// Encodes orders. One command carries the set-points of consecutive channels if the orders are sorted by channel.
    fn encode(
        &self,
        orders: &[ActuatorCommand],
        send: &mut dyn FnMut(Packet),
    ) -> Result<(), (usize, Refusal)> {
        for (i, order) in orders.iter().enumerate() {
            self.emit(order, &mut |_| {}).map_err(|refusal| (i, refusal))?;
        }
        let mut targets = heapless::Vec::<u16, 24>::new();
        let mut first = 0;
        for (i, order) in (0..orders.len()).zip(orders) {
            let next = usize::from(order.id) == usize::from(first).saturating_add(targets.len());
            let continues = next && matches!(order.command, Command::Joint(_));
            if !targets.is_empty() && !continues {
                send(self.set_targets(first, &targets));
                targets.clear();
            }
            let Command::Joint(joint) = order.command else {
                self.emit(order, send).map_err(|refusal| (i, refusal))?;
                continue;
            };
            if !self.set_multiple {
                send(
                    self.set_target(order.id, self.target(joint.position_rad).map_err(|r| (i, r))?),
                );
                continue;
            }
            if targets.is_empty() {
                first = order.id;
            }
            // At most as many targets as channels, because higher addresses are refused.
            let _ = targets.push(self.target(joint.position_rad).map_err(|r| (i, r))?);
        }
        if !targets.is_empty() {
            send(self.set_targets(first, &targets));
        }
        Ok(())
    }

    /// Counts the targets, one error query and its answer.
    fn traffic(&self, actuators: u32) -> Traffic {
        let around = if self.device.is_some() { 3 } else { 1 } + u32::from(self.crc);
        let (once, each) = if self.set_multiple { (2 + around, 2) } else { (0, 3 + around) };
        polled(actuators, once + around + 2, each, 0)
    }

    fn from_keys(keys: &dyn Keys) -> Self {
        let usual = Pulse::default();
        let number = |key, usual| or(keys, key, usual, |key| keys.number(key));
        let device = or(keys, "device", None, |key| Some(keys.integer(key, DEVICES) as u8));
        let crc = or(keys, "crc", false, |key| keys.boolean(key));
        let set_multiple = or(keys, "set_multiple", true, |key| keys.boolean(key));
        let pulse = Pulse {
            centre_us: number("centre_us", usual.centre_us),
            us_per_rad: number("us_per_rad", usual.us_per_rad),
            limits_us: or(keys, "pulse_us", usual.limits_us, |key| keys.pair(key)),
        };
        Self { device, crc, set_multiple, pulse }
    }

    fn check_settings(&self, report: &mut dyn Report) {
        if let Some(device) = self.device {
            check_integer(report, "device", device.into(), DEVICES, "");
        }
        let Pulse { us_per_rad, limits_us: (least, most), .. } = self.pulse;
        if !(1.0..=10_000.0).contains(&us_per_rad.abs()) {
            let help = format_args!(
                "give 1 to 10000 µs/rad, or a negative value if the servo turns the \
                    other way"
            );
            report.violated("us_per_rad", format_args!("is {us_per_rad} µs/rad"), help);
        }
        if !(least >= 1.0 && most > least && most <= 4000.0) {
            let help = format_args!("give the shortest and the longest pulse, from 1 to 4000 µs");
            report.violated("pulse_us", format_args!("is [{least}, {most}] µs"), help);
        }
    }

    fn explain_range(&self, quantity: &'static str, report: &mut dyn FnMut(Arguments<'_>)) {
        if quantity == "position" {
            let Pulse { centre_us, us_per_rad, limits_us: (least, most) } = self.pulse;
            let ends = [least, most].map(|pulse_us| (pulse_us - centre_us) / us_per_rad);
            let (min, max) = (ends[0].min(ends[1]), ends[0].max(ends[1]));
            report(format_args!(
                "its pulses of {least} to {most} µs correspond to {min:.3} to {max:.3} rad; give \
                 an angle in this range, or correct `centre_us` and `us_per_rad`"
            ));
        }
    }
}

impl SerialCodec for Maestro {
    /// True: the board reports errors, its servos report nothing.
    const ADAPTER_ANSWERS: bool = true;

    fn receive(&self, buffer: &mut ReceiveBuffer, byte: u8, is_awaited: bool) {
        if is_awaited || !buffer.bytes().is_empty() {
            buffer.push(byte);
        }
    }

    fn take(&self, buffer: &mut ReceiveBuffer, is_silent: bool) -> Option<Answer> {
        let answer = match *buffer.bytes() {
            [low, high, ..] => Some(Answer::Adapter(Self::errors([low, high]))),
            _ => None,
        };
        if is_silent || answer.is_some() {
            buffer.clear();
        }
        answer.filter(|_| !is_silent)
    }
}
