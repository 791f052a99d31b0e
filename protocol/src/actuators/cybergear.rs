//! Xiaomi CyberGear motors in operation control mode.
//!
//! Document: "CyberGear micro motor instruction manual", section 4. Identifier = type (5 bits) │ data (16 bits) │ target (8
//! bits). Scaled values are big-endian, parameters little-endian. The identifier contains the torque of a set-point.

use core::fmt::Arguments;

use serde::{Deserialize, Serialize};

use super::fixed::{Signed, Unsigned};
use super::settings::{Keys, Report};
use super::{
    ActuatorCommand, Answers, CanCodec, Capabilities, Codec, Command, Faults, Feedback, Gains,
    JointSetpoint, Refusal, Traffic, UpdatePolicy, Watchdog, without,
};
use crate::can::{Frame, worst_case_bits_extended};

/// Largest position according to the tables of the manual, rad: 4π.
pub const TABLE_MAX_RAD: f32 = 4.0 * core::f32::consts::PI;
/// Largest position according to the sample program of the manual, rad.
pub const SAMPLE_MAX_RAD: f32 = 12.5;
/// Largest speed, rad/s.
pub const MAX_SPEED_RAD_S: f32 = 30.0;
/// Largest torque, N·m.
pub const MAX_TORQUE_NM: f32 = 12.0;

/// Motors on a bus.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct CyberGear {
    /// Address of the host on the bus; motors answer to it.
    pub host: u8,
    /// Largest position: [`TABLE_MAX_RAD`] or [`SAMPLE_MAX_RAD`], since the manual gives both. Compare the feedback of a motor
    /// with [`MECHANICAL_POSITION`] to find out which applies.
    pub max_position_rad: f32,
}

const GET_ID: u8 = 0;
const CONTROL: u8 = 1;
const FEEDBACK: u8 = 2;
const ENABLE: u8 = 3;
const STOP: u8 = 4;
const SET_ZERO: u8 = 6;
const READ_PARAMETER: u8 = 17;
const WRITE_PARAMETER: u8 = 18;
const FAULT: u8 = 21;

/// Parameter: 0 operation control, 1 position, 2 speed, 3 current. One byte.
pub const RUN_MODE: u16 = 0x7005;
/// Parameter: torque limit, N·m.
pub const TORQUE_LIMIT: u16 = 0x700B;
/// Parameter: speed limit of the position mode, rad/s.
pub const SPEED_LIMIT: u16 = 0x7017;
/// Parameter, read only: position of the output, rad.
pub const MECHANICAL_POSITION: u16 = 0x7019;

/// Fault bits of a feedback frame, from bit 16 of its identifier up.
const FEEDBACK_FAULTS: [(u32, Faults); 5] = [
    (1 << 0, Faults::BAD_VOLTAGE),     // under voltage
    (1 << 1, Faults::OVERCURRENT),     // over current
    (1 << 2, Faults::OVERHEATED),      // over temperature
    (1 << 3 | 1 << 4, Faults::SENSOR), // magnetic encoder, HALL encoder
    (1 << 5, Faults::SENSOR),          // not calibrated
];

/// Fault bits of a fault frame.
const FAULT_BITS: [(u32, Faults); 4] = [
    (1 << 0, Faults::OVERHEATED),
    (1 << 2 | 1 << 3, Faults::BAD_VOLTAGE), // under and over voltage
    (1 << 4 | 1 << 5 | 1 << 16 | 0xFF00, Faults::OVERCURRENT), // phases C, B, A; overload
    (1 << 7, Faults::SENSOR),               // encoder not calibrated
];

const SPEED: Signed = Signed { max: MAX_SPEED_RAD_S, bits: 16 };
const TORQUE: Signed = Signed { max: MAX_TORQUE_NM, bits: 16 };
const KP: Unsigned = Unsigned { max: 500.0, bits: 16 };
const KD: Unsigned = Unsigned { max: 5.0, bits: 16 };

fn frame(kind: u8, data16: u16, target: u8, data: [u8; 8]) -> Frame {
    let id = u32::from(kind) << 24 | u32::from(data16) << 8 | u32::from(target);
    Frame::known_extended(id, data)
}

impl CyberGear {
    fn command(&self, kind: u8, motor: u8, first: u8) -> Frame {
        frame(kind, u16::from(self.host), motor, [first, 0, 0, 0, 0, 0, 0, 0])
    }

    /// Requests the device identifier. The motor answers with type 0 and its 64-bit identifier.
    pub fn get_id(&self, motor: u8) -> Frame {
        self.command(GET_ID, motor, 0)
    }

    /// Makes the present position 0 until power-off. Do not send it while torque is on: the motor keeps its set-point, and the
    /// joint moves there.
    pub fn zero_here(&self, motor: u8) -> Frame {
        self.command(SET_ZERO, motor, 1)
    }

    /// Requests a parameter; [`parameter`](Self::parameter) decodes the answer.
    pub fn read(&self, motor: u8, index: u16) -> Frame {
        let [i0, i1] = index.to_le_bytes();
        frame(READ_PARAMETER, u16::from(self.host), motor, [i0, i1, 0, 0, 0, 0, 0, 0])
    }

    /// Writes a parameter, which applies until power-off. Encode floats with `f32::to_le_bytes`, and a byte as the first of
    /// four.
    pub fn write(&self, motor: u8, index: u16, value: [u8; 4]) -> Frame {
        let [i0, i1] = index.to_le_bytes();
        let [a, b, c, d] = value;
        frame(WRITE_PARAMETER, u16::from(self.host), motor, [i0, i1, 0, 0, a, b, c, d])
    }

    /// Motor, index and value of the answer to [`read`](Self::read).
    pub fn parameter(&self, received: &Frame) -> Option<(u8, u16, [u8; 4])> {
        let (READ_PARAMETER, data16, target) = parts(received)? else { return None };
        let &[i0, i1, _, _, a, b, c, d] = received.data() else { return None };
        let to_us = target == self.host;
        to_us.then_some((data16 as u8, u16::from_le_bytes([i0, i1]), [a, b, c, d]))
    }

    fn control(&self, motor: u8, joint: &JointSetpoint) -> Result<Frame, Refusal> {
        let gains = joint.gains.ok_or(Refusal::Missing("gains"))?;
        let beyond = Refusal::OutOfRange;
        let position = Signed { max: self.max_position_rad, bits: 16 };
        let codes = [
            position.encode(joint.position_rad).ok_or(beyond("position"))?,
            SPEED.encode(joint.speed_rad_s).ok_or(beyond("speed"))?,
            KP.encode(gains.kp_nm_rad).ok_or(beyond("kp"))?,
            KD.encode(gains.kd_nm_s_rad).ok_or(beyond("kd"))?,
        ];
        let torque = TORQUE.encode(joint.torque_nm).ok_or(beyond("torque"))?;
        let [[a, b], [c, d], [e, f], [g, h]] = codes.map(u16::to_be_bytes);
        Ok(frame(CONTROL, torque, motor, [a, b, c, d, e, f, g, h]))
    }

    /// Builds a set-point of torque alone, with zero gains.
    fn free(&self, motor: u8, position_rad: f32, torque_nm: f32) -> Result<Frame, Refusal> {
        let gains = Some(Gains { kp_nm_rad: 0.0, kd_nm_s_rad: 0.0 });
        let speed_rad_s = 0.0;
        self.control(motor, &JointSetpoint { position_rad, speed_rad_s, torque_nm, gains })
    }

    fn limits(&self, speed_rad_s: f32, torque_nm: f32) -> Result<(), Refusal> {
        let within = |x: f32, most: f32| x > 0.0 && x <= most;
        if !within(speed_rad_s, MAX_SPEED_RAD_S) {
            return Err(Refusal::OutOfRange("speed"));
        }
        if within(torque_nm, MAX_TORQUE_NM) { Ok(()) } else { Err(Refusal::OutOfRange("torque")) }
    }
}

/// Splits an identifier into type, data and target.
fn parts(frame: &Frame) -> Option<(u8, u16, u8)> {
    let id = frame.extended_id()?;
    Some(((id >> 24) as u8, (id >> 8) as u16, id as u8))
}

impl Codec for CyberGear {
    type Sent = Frame;

    const EXAMPLES: &'static [Self] = &[Self { host: 0xFD, max_position_rad: TABLE_MAX_RAD }];

    fn name(&self) -> &'static str {
        "CyberGear"
    }

    fn capabilities(&self) -> Capabilities {
        Capabilities {
            joints: true,
            wheels: true,
            gains: UpdatePolicy::EverySetpoint,
            max_gains: Gains { kp_nm_rad: KP.max, kd_nm_s_rad: KD.max },
            limits: UpdatePolicy::Stored,
            joint_speed: true,
            torque: true,
            torque_alone: true,
            exact_zero_speed: false,
            answers: Answers::Always,
            measures_position: true,
            measures_torque: true,
            query: false,
            query_readings: false,
            reports_enabled: true,
            // Stop is answered even if it changes nothing.
            pose_while_disabled: true,
            watchdog: Watchdog::Unknown,
            max_id: 0x7F,
        }
    }

    /// Encodes an order. Enabling selects the operation control mode, and sends a limp set-point before and after.
    fn emit(&self, order: &ActuatorCommand, send: &mut dyn FnMut(Frame)) -> Result<(), Refusal> {
        let motor = order.id;
        super::address(motor, 0x7F)?;
        let limp = match order.command {
            Command::Disable => {
                send(self.command(STOP, motor, 0));
                return Ok(());
            }
            // The command also stops the motor.
            Command::ClearFaults => {
                send(self.command(STOP, motor, 1));
                return Ok(());
            }
            Command::Query | Command::QueryReadings => {
                return Err(Refusal::Unsupported("query"));
            }
            Command::Gains(_) => return Err(Refusal::Unsupported("gains outside setpoints")),
            Command::Limits { speed_rad_s, torque_nm } => {
                self.limits(speed_rad_s, torque_nm)?;
                send(self.write(motor, TORQUE_LIMIT, torque_nm.to_le_bytes()));
                send(self.write(motor, SPEED_LIMIT, speed_rad_s.to_le_bytes()));
                return Ok(());
            }
            Command::Joint(joint) => {
                send(self.control(motor, &joint)?);
                return Ok(());
            }
            Command::Wheel(wheel) => {
                without(wheel.torque_limit_nm, "torque limit in setpoints")?;
                let kd_nm_s_rad = wheel.kd_nm_s_rad.ok_or(Refusal::Missing("kd"))?;
                let joint = JointSetpoint {
                    position_rad: 0.0,
                    speed_rad_s: wheel.speed_rad_s,
                    torque_nm: wheel.torque_nm,
                    gains: Some(Gains { kp_nm_rad: 0.0, kd_nm_s_rad }),
                };
                send(self.control(motor, &joint)?);
                return Ok(());
            }
            Command::Torque { torque_nm } => {
                send(self.free(motor, 0.0, torque_nm)?);
                return Ok(());
            }
            Command::EnableJoint { measured_rad } => self.free(motor, measured_rad, 0.0)?,
            Command::EnableWheel | Command::EnableTorque => self.free(motor, 0.0, 0.0)?,
        };
        send(self.write(motor, RUN_MODE, [0; 4]));
        send(limp);
        send(self.command(ENABLE, motor, 0));
        send(limp);
        Ok(())
    }

    fn traffic(&self, actuators: u32) -> Traffic {
        let bits_per_period = actuators.saturating_mul(2 * worst_case_bits_extended(8));
        Traffic { bits_per_period, ..Traffic::default() }
    }

    fn from_keys(keys: &dyn Keys) -> Self {
        Self {
            host: keys.integer("host_id", 0..=255) as u8,
            max_position_rad: keys.number("max_position_rad"),
        }
    }

    fn check_settings(&self, report: &mut dyn Report) {
        let max_position_rad = self.max_position_rad;
        // A file may contain only a few digits of 4π.
        if ![SAMPLE_MAX_RAD, TABLE_MAX_RAD]
            .iter()
            .any(|most| (max_position_rad - most).abs() < 1e-3)
        {
            let help = format_args!(
                "give 12.5 or 12.566 (4π), the two values of the manual; docs/actuators.md \
                 describes how to find the right one"
            );
            report.violated("max_position_rad", format_args!("is {max_position_rad} rad"), help);
        }
    }

    fn explain_range(&self, quantity: &'static str, report: &mut dyn FnMut(Arguments<'_>)) {
        match quantity {
            "speed" => report(format_args!("give at most {MAX_SPEED_RAD_S} rad/s")),
            "torque" => report(format_args!("give at most {MAX_TORQUE_NM} N·m")),
            _ => {}
        }
    }
}

impl CanCodec for CyberGear {
    fn decode(&self, received: &Frame) -> Option<(u8, Feedback)> {
        let (kind, data16, target) = parts(received)?;
        let &[a, b, c, d, e, f, g, h] = received.data() else { return None };
        // Type 21 is accepted with its addresses in either order: the motor in the data, as in feedback, or as the target, as in
        // a command.
        let motor = if target == self.host { data16 as u8 } else { target };
        match kind {
            FEEDBACK if target == self.host => {
                let position = Signed { max: self.max_position_rad, bits: 16 };
                let faults = u32::from(data16 >> 8 & 0x3F);
                let feedback = Feedback {
                    position_rad: Some(position.decode(u16::from_be_bytes([a, b]))),
                    speed_rad_s: Some(SPEED.decode(u16::from_be_bytes([c, d]))),
                    torque_nm: Some(TORQUE.decode(u16::from_be_bytes([e, f]))),
                    temperature_c: Some(f32::from(u16::from_be_bytes([g, h])) / 10.0),
                    voltage_v: None,
                    // 0 reset, 1 calibrating, 2 running.
                    enabled: Some(data16 >> 14 == 2),
                    faults: Some(Faults::translate(faults, &FEEDBACK_FAULTS)),
                };
                Some((motor, feedback))
            }
            FAULT => {
                let faults = Faults::translate(u32::from_le_bytes([a, b, c, d]), &FAULT_BITS);
                Some((motor, Feedback { faults: Some(faults), ..Feedback::default() }))
            }
            _ => None,
        }
    }
}
