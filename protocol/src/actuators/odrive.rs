//! ODrive CANSimple, for firmware 0.5 (ODrive v3) and 0.6 (Pro, S1, Micro).
//!
//! Documents: ODrive firmware 0.5.6, `docs/can-protocol.rst` and `tools/odrive-cansimple.dbc`; CAN protocol page and
//! `odrive-cansimple.dbc` of 0.6.10. Identifier = node (6 bits) │ command (5 bits). Integers and floats are little-endian.
//! Turns, turns/s and N·m refer to the motor.
//!
//! The controller never queries a drive, since every frame to an axis feeds its watchdog, even a request. The drive sends
//! heartbeat and estimates on timers.

use core::f32::consts::TAU;
use core::fmt::Arguments;
use core::ops::RangeInclusive;

use serde::{Deserialize, Serialize};

use super::fixed::nearest;
use super::settings::{Keys, Report, check_integer};
use super::{
    ActuatorCommand, Answers, CanCodec, Capabilities, Codec, Command, Faults, Feedback, Gains,
    Refusal, Traffic, UpdatePolicy, Watchdog, without,
};
use crate::can::{Frame, worst_case_bits};

/// Firmware of the drives, which determines heartbeats and error bits.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Version {
    /// Firmware 0.5.
    #[serde(rename = "0.5")]
    V05,
    /// Firmware 0.6.
    #[serde(rename = "0.6")]
    V06,
}

/// Drives with common settings on a bus.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Odrive {
    /// Firmware version of the drives.
    pub version: Version,
    /// Turns of the motor per turn of the joint or wheel; negative if the motor turns the other way.
    pub reduction: f32,
    /// Torque constant of the motor, N·m/A.
    pub torque_constant_nm_a: f32,
    /// Rate of the estimates and of the torques or currents of a drive, Hz (`encoder_rate_ms` and similar settings).
    pub estimates_hz: u32,
}

/// Largest node number.
pub const MAX_NODE: u8 = 0x3F;
/// Scale of the feed-forward in a position set-point: steps per turn/s and per N·m.
const FEED_FORWARD_STEPS: f32 = 1000.0;
/// Heartbeat rate as delivered, Hz.
const HEARTBEAT_HZ: u32 = 10;

const HEARTBEAT: u16 = 0x01;
const ESTOP: u16 = 0x02;
const GET_ERROR_06: u16 = 0x03;
const SET_AXIS_STATE: u16 = 0x07;
const ENCODER_ESTIMATES: u16 = 0x09;
const SET_CONTROLLER_MODE: u16 = 0x0B;
const SET_INPUT_POS: u16 = 0x0C;
const SET_INPUT_VEL: u16 = 0x0D;
const SET_INPUT_TORQUE: u16 = 0x0E;
const SET_LIMITS: u16 = 0x0F;
const GET_IQ: u16 = 0x14;
const GET_TEMPERATURE_06: u16 = 0x15;
const CLEAR_ERRORS: u16 = 0x18;
const SET_POS_GAIN: u16 = 0x1A;
const SET_VEL_GAINS: u16 = 0x1B;
const GET_TORQUES_06: u16 = 0x1C;

/// Accepted rates of a drive's estimates, Hz. Drives support only periods of whole milliseconds, a subset of this range.
const ESTIMATES_HZ: RangeInclusive<u32> = 1..=10_000;

/// Axis state without torque.
const IDLE: u32 = 1;
/// Axis state that follows set-points.
const CLOSED_LOOP_CONTROL: u32 = 8;
/// Control mode: torque.
const TORQUE_CONTROL: u32 = 1;
/// Control mode: velocity.
const VELOCITY_CONTROL: u32 = 2;
/// Control mode: position.
const POSITION_CONTROL: u32 = 3;
/// Input mode that applies set-points unchanged.
const PASSTHROUGH: u32 = 1;

/// Axis errors of firmware 0.5.
const ERRORS_05: [(u32, Faults); 8] = [
    (0x0000_0001, Faults::REFUSED),              // invalid state
    (0x0000_0040 | 0x0000_0200, Faults::OTHER),  // motor failed, controller failed
    (0x0000_0080 | 0x0000_0100, Faults::SENSOR), // sensorless estimator, encoder failed
    (0x0000_0800, Faults::TIMED_OUT),            // watchdog timer expired
    (0x0000_1000 | 0x0000_2000, Faults::OTHER),  // an end stop was pressed
    (0x0000_4000, Faults::ESTOPPED),             // estop requested
    (0x0004_0000, Faults::OVERHEATED),           // over temperature
    (0x0002_0000 | 0x0008_0000, Faults::SENSOR), // homing without end stop, unknown position
];

/// Errors of firmware 0.6.
const ERRORS_06: [(u32, Faults); 7] = [
    (0x0000_0100 | 0x0000_0200, Faults::BAD_VOLTAGE), // DC bus over voltage, under voltage
    (0x0000_0400 | 0x0000_0800 | 0x0000_1000, Faults::OVERCURRENT), // bus, regen, limit violation
    (0x0000_2000 | 0x0000_4000, Faults::OVERHEATED),  // motor, inverter
    (0x0000_0008 | 0x0400_0000, Faults::SENSOR),      // missing estimate, spinout detected
    (0x0000_0040, Faults::REFUSED),                   // missing input
    (0x0100_0000, Faults::TIMED_OUT),                 // watchdog timer expired
    (0x0200_0000, Faults::ESTOPPED),                  // estop requested
];

fn frame<const N: usize>(node: u8, command: u16, data: [u8; N]) -> Frame {
    Frame::known(u16::from(node) << 5 | command, data)
}

fn eight(low: [u8; 4], high: [u8; 4]) -> [u8; 8] {
    let ([a, b, c, d], [e, f, g, h]) = (low, high);
    [a, b, c, d, e, f, g, h]
}

fn floats(node: u8, command: u16, low: f32, high: f32) -> Frame {
    frame(node, command, eight(low.to_le_bytes(), high.to_le_bytes()))
}

fn integers(node: u8, command: u16, low: u32, high: u32) -> Frame {
    frame(node, command, eight(low.to_le_bytes(), high.to_le_bytes()))
}

/// Returns `value` if it is finite. Commands contain floats, so every finite value fits.
fn number(value: f32, name: &'static str) -> Result<f32, Refusal> {
    if value.is_finite() { Ok(value) } else { Err(Refusal::OutOfRange(name)) }
}

/// Returns a limit if it is finite and above 0.
fn positive(value: f32, name: &'static str) -> Result<f32, Refusal> {
    if value > 0.0 { number(value, name) } else { Err(Refusal::OutOfRange(name)) }
}

/// Builds the emergency stop of an axis: torque off, and an error until [`Command::ClearFaults`].
pub fn estop(node: u8) -> Frame {
    frame(node, ESTOP, [])
}

impl Odrive {
    fn state(&self, node: u8, state: u32) -> Frame {
        frame(node, SET_AXIS_STATE, state.to_le_bytes())
    }

    /// Builds a position set-point in the units of the motor.
    fn position(
        &self,
        node: u8,
        position_rad: f32,
        speed_rad_s: f32,
        torque_nm: f32,
    ) -> Result<Frame, Refusal> {
        let turns = number(position_rad * self.reduction / TAU, "position")?;
        let steps = |value: f32, name| {
            nearest(value * FEED_FORWARD_STEPS, -32767, 32767)
                .map(|steps| (steps as i16).to_le_bytes())
                .ok_or(Refusal::OutOfRange(name))
        };
        let [v0, v1] = steps(speed_rad_s * self.reduction / TAU, "speed")?;
        let [t0, t1] = steps(torque_nm / self.reduction, "torque")?;
        Ok(frame(node, SET_INPUT_POS, eight(turns.to_le_bytes(), [v0, v1, t0, t1])))
    }

    fn speed(&self, node: u8, speed_rad_s: f32, torque_nm: f32) -> Result<Frame, Refusal> {
        let turns_s = number(speed_rad_s * self.reduction / TAU, "speed")?;
        let torque_nm = number(torque_nm / self.reduction, "torque")?;
        Ok(floats(node, SET_INPUT_VEL, turns_s, torque_nm))
    }

    fn torque(&self, node: u8, torque_nm: f32) -> Result<Frame, Refusal> {
        let torque_nm = number(torque_nm / self.reduction, "torque")?;
        Ok(frame(node, SET_INPUT_TORQUE, torque_nm.to_le_bytes()))
    }

    /// Builds the frames of gains.
    ///
    /// The cascade of an ODrive is torque = g_v (g_p (q* − q) + q̇* − q̇). Hence g_v is kd, and g_p is kp / kd. The integral
    /// gain is set to 0.
    fn gains(&self, node: u8, gains: Gains) -> Result<[Frame; 2], Refusal> {
        let kd = positive(gains.kd_nm_s_rad, "kd")?;
        if gains.kp_nm_rad < 0.0 {
            return Err(Refusal::OutOfRange("kp"));
        }
        let position_gain = number(gains.kp_nm_rad / kd, "kp")?;
        let per_turn = TAU / (self.reduction * self.reduction);
        let speed_gain = number(kd * per_turn, "kd")?;
        Ok([
            frame(node, SET_POS_GAIN, position_gain.to_le_bytes()),
            floats(node, SET_VEL_GAINS, speed_gain, 0.0),
        ])
    }

    fn limits(&self, node: u8, speed_rad_s: f32, torque_nm: f32) -> Result<Frame, Refusal> {
        let reduction = self.reduction.abs();
        let turns_s = positive(speed_rad_s * reduction / TAU, "speed")?;
        let current_a = positive(torque_nm / reduction / self.torque_constant_nm_a, "torque")?;
        Ok(floats(node, SET_LIMITS, turns_s, current_a))
    }

    fn heartbeat(&self, data: [u8; 8]) -> Feedback {
        let [e0, e1, e2, e3, state, flags @ ..] = data;
        let error = u32::from_le_bytes([e0, e1, e2, e3]);
        let faults = match self.version {
            // The error may be 0 while a component has an error, so the flags also count.
            Version::V05 => {
                let [motor, encoder, controller] = flags;
                let mut faults = Faults::translate(error, &ERRORS_05).0;
                if (motor | controller) & 1 != 0 {
                    faults |= Faults::OTHER.0;
                }
                if encoder & 1 != 0 {
                    faults |= Faults::SENSOR.0;
                }
                Faults(faults)
            }
            Version::V06 => Faults::translate(error, &ERRORS_06),
        };
        let enabled = Some(u32::from(state) == CLOSED_LOOP_CONTROL);
        Feedback { enabled, faults: Some(faults), ..Feedback::default() }
    }
}

const EXAMPLE: Odrive = Odrive {
    version: Version::V05,
    reduction: -9.0,
    torque_constant_nm_a: 0.05,
    estimates_hz: 120,
};

/// Returns `value` unless it is NaN or infinite.
fn finite(value: f32) -> Option<f32> {
    value.is_finite().then_some(value)
}

/// Decodes two floats; `None` unless both are finite.
fn two_floats(data: [u8; 8]) -> Option<(f32, f32)> {
    let [a, b, c, d, e, f, g, h] = data;
    let (low, high) = (f32::from_le_bytes([a, b, c, d]), f32::from_le_bytes([e, f, g, h]));
    finite(low).zip(finite(high))
}

impl Codec for Odrive {
    type Sent = Frame;

    const EXAMPLES: &'static [Self] = &[EXAMPLE, Self { version: Version::V06, ..EXAMPLE }];

    fn name(&self) -> &'static str {
        "ODrive"
    }

    fn capabilities(&self) -> Capabilities {
        Capabilities {
            joints: true,
            wheels: true,
            gains: UpdatePolicy::Stored,
            max_gains: Gains { kp_nm_rad: f32::MAX, kd_nm_s_rad: f32::MAX },
            limits: UpdatePolicy::Stored,
            joint_speed: true,
            torque: true,
            torque_alone: true,
            exact_zero_speed: true,
            answers: Answers::Cyclic,
            measures_position: true,
            measures_torque: true,
            query: false,
            query_readings: false,
            reports_enabled: true,
            pose_while_disabled: true,
            watchdog: Watchdog::Latches,
            max_id: MAX_NODE,
        }
    }

    fn emit(&self, order: &ActuatorCommand, send: &mut dyn FnMut(Frame)) -> Result<(), Refusal> {
        let node = order.id;
        super::address(node, MAX_NODE)?;
        let mode = |mode| integers(node, SET_CONTROLLER_MODE, mode, PASSTHROUGH);
        match order.command {
            Command::Disable => send(self.state(node, IDLE)),
            Command::EnableJoint { measured_rad } => {
                let here = self.position(node, measured_rad, 0.0, 0.0)?;
                send(mode(POSITION_CONTROL));
                send(here);
                send(self.state(node, CLOSED_LOOP_CONTROL));
            }
            Command::EnableWheel => {
                let still = self.speed(node, 0.0, 0.0)?;
                send(mode(VELOCITY_CONTROL));
                send(still);
                send(self.state(node, CLOSED_LOOP_CONTROL));
            }
            Command::EnableTorque => {
                let none = self.torque(node, 0.0)?;
                send(mode(TORQUE_CONTROL));
                send(none);
                send(self.state(node, CLOSED_LOOP_CONTROL));
            }
            Command::Torque { torque_nm } => send(self.torque(node, torque_nm)?),
            Command::Query | Command::QueryReadings => return Err(Refusal::Unsupported("query")),
            // Firmware 0.6 reads the byte as "identify"; 0.5 ignores it.
            Command::ClearFaults => send(frame(node, CLEAR_ERRORS, [0])),
            Command::Gains(gains) => self.gains(node, gains)?.into_iter().for_each(send),
            Command::Limits { speed_rad_s, torque_nm } => {
                send(self.limits(node, speed_rad_s, torque_nm)?);
            }
            Command::Joint(joint) => {
                without(joint.gains, "gains in setpoints")?;
                let (position, speed) = (joint.position_rad, joint.speed_rad_s);
                send(self.position(node, position, speed, joint.torque_nm)?);
            }
            Command::Wheel(wheel) => {
                without(wheel.kd_nm_s_rad, "kd in setpoints")?;
                without(wheel.torque_limit_nm, "torque limit in setpoints")?;
                send(self.speed(node, wheel.speed_rad_s, wheel.torque_nm)?);
            }
        }
        Ok(())
    }

    fn traffic(&self, actuators: u32) -> Traffic {
        let bits = actuators.saturating_mul(worst_case_bits(8));
        let cyclic_hz = self.estimates_hz.saturating_mul(2).saturating_add(HEARTBEAT_HZ);
        Traffic {
            bits_per_period: bits,
            bits_per_s: bits.saturating_mul(cyclic_hz),
            ..Traffic::default()
        }
    }

    fn feedback_hz(&self) -> Option<u32> {
        Some(self.estimates_hz)
    }

    fn from_keys(keys: &dyn Keys) -> Self {
        let version = keys.choice("firmware", &["0.5", "0.6"]);
        Self {
            version: if version == 0 { Version::V05 } else { Version::V06 },
            reduction: keys.number("reduction"),
            torque_constant_nm_a: keys.number("torque_constant_nm_a"),
            estimates_hz: keys.integer("estimates_hz", ESTIMATES_HZ),
        }
    }

    fn check_settings(&self, report: &mut dyn Report) {
        let Self { reduction, torque_constant_nm_a, estimates_hz, .. } = *self;
        check_integer(report, "estimates_hz", estimates_hz, ESTIMATES_HZ, " Hz");
        if !(1e-3..=1e3).contains(&reduction.abs()) {
            let help = format_args!(
                "give the motor turns per joint turn, from 0.001 to 1000, or a negative value if \
                 the motor turns the other way"
            );
            report.violated("reduction", format_args!("is {reduction}"), help);
        }
        if !(1e-4..=100.0).contains(&torque_constant_nm_a) {
            let problem = format_args!("is {torque_constant_nm_a} N·m/A");
            let help = format_args!(
                "give 0.0001 to 100 N·m/A: 8.27 / KV, with the motor's KV in \
                rpm/V"
            );
            report.violated("torque_constant_nm_a", problem, help);
        }
    }

    fn explain_range(&self, quantity: &'static str, report: &mut dyn FnMut(Arguments<'_>)) {
        if quantity == "kd" {
            report(format_args!("give kd above 0, because the drive's kp is a multiple of kd"));
        }
    }
}

impl CanCodec for Odrive {
    fn decode(&self, received: &Frame) -> Option<(u8, Feedback)> {
        let data: [u8; 8] = received.data().try_into().ok()?;
        let id = received.standard_id()?;
        let node = (id >> 5) as u8;
        let nothing = Feedback::default();
        let feedback = match (id & 0x1F, self.version) {
            (HEARTBEAT, _) => self.heartbeat(data),
            (ENCODER_ESTIMATES, _) => {
                let (turns, turns_s) = two_floats(data)?;
                Feedback {
                    position_rad: Some(finite(turns * TAU / self.reduction)?),
                    speed_rad_s: Some(finite(turns_s * TAU / self.reduction)?),
                    ..nothing
                }
            }
            (GET_IQ, _) => {
                let (_, measured_a) = two_floats(data)?;
                let torque_nm = finite(measured_a * self.torque_constant_nm_a * self.reduction)?;
                Feedback { torque_nm: Some(torque_nm), ..nothing }
            }
            (GET_TORQUES_06, Version::V06) => {
                let (_, estimate_nm) = two_floats(data)?;
                Feedback { torque_nm: Some(finite(estimate_nm * self.reduction)?), ..nothing }
            }
            (GET_TEMPERATURE_06, Version::V06) => {
                let (_, motor_c) = two_floats(data)?;
                Feedback { temperature_c: Some(motor_c), ..nothing }
            }
            (GET_ERROR_06, Version::V06) => {
                let [a, b, c, d, ..] = data;
                let active = u32::from_le_bytes([a, b, c, d]);
                Feedback { faults: Some(Faults::translate(active, &ERRORS_06)), ..nothing }
            }
            _ => return None,
        };
        Some((node, feedback))
    }
}
