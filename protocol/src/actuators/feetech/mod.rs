//! Feetech servos of the STS and SMS series, on a half-duplex serial line.
//!
//! Documents: Feetech, "Communication Protocol User Manual" (FT-SCS) and the memory tables ([`table`]). One sync write carries
//! all commands of one kind, and one sync read all queries, as for Dynamixel servos.

use core::f32::consts::PI;
use core::fmt::Arguments;
use core::ops::RangeInclusive;

use heapless::Vec;
use serde::{Deserialize, Serialize};

use super::fixed::nearest;
use super::named;
use super::serial::{Answer, MAX_ON_LINE, ReceiveBuffer};
use super::settings::{Keys, Report, check_integer};
use super::traffic::polled;
use super::{
    ActuatorCommand, Answers, Capabilities, Codec, Command, Faults, Feedback, Packet, Refusal,
    SerialCodec, Traffic, UpdatePolicy, Watchdog, without, without_torque,
};
use crate::packet::append;

pub mod packet;
pub mod table;

use packet::{ANSWER_BYTES, BROADCAST, MAX_ID, SYNC_READ, SYNC_WRITE};
use table::{CENTRE, Model, STEP_RAD, STS3215_C001, VOLTAGE_STEP_V};

/// Servos of one model on a line.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Feetech {
    /// Model of the servos.
    #[serde(with = "named")]
    pub model: Model,
    /// Return delay of the servos ("Return delay"), µs; 500 µs as delivered.
    pub return_delay_us: u32,
}

/// Range of the return delay, µs: up to 254 steps of 2 µs.
const RETURN_DELAYS_US: RangeInclusive<u32> = 0..=508;

/// Fault bits in the status of an answer: voltage, encoder, temperature, current and load.
const STATUS: [(u32, Faults); 4] = [
    (1 << 0, Faults::BAD_VOLTAGE),
    (1 << 1, Faults::SENSOR),
    (1 << 2, Faults::OVERHEATED),
    (1 << 3 | 1 << 5, Faults::OVERCURRENT),
];

/// Address range: first address and number of bytes written.
type Range = (u8, u8);

const SWITCH: Range = (table::TORQUE_ENABLE, 1);
const LIMIT: Range = (table::TORQUE_LIMIT, 2);
/// Acceleration, position, two unused bytes and velocity.
const MOTION: Range = (table::ACCELERATION, 7);
const ACCELERATION: Range = (table::ACCELERATION, 1);
/// Goal position of a joint.
const POSITION: Range = (table::GOAL_POSITION, 2);
/// Goal velocity of a wheel.
const VELOCITY: Range = (table::GOAL_VELOCITY, 2);

/// Address ranges that [`Feetech::encode`] writes, most urgent first.
const RANGES: [Range; 6] = [SWITCH, LIMIT, ACCELERATION, MOTION, POSITION, VELOCITY];

/// Values for a range of [`RANGES`]. The range defines how many of the bytes are sent.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Write {
    range: Range,
    data: [u8; 7],
}

impl Write {
    fn byte(range: Range, byte: u8) -> Self {
        Self { range, data: [byte, 0, 0, 0, 0, 0, 0] }
    }

    fn word(range: Range, [low, high]: [u8; 2]) -> Self {
        Self { range, data: [low, high, 0, 0, 0, 0, 0] }
    }
}

/// Register writes of an order, in sequence.
type Writes = Vec<Write, 3>;

/// Decodes a magnitude whose sign is in `bit`.
fn signed(bytes: [u8; 2], bit: u32) -> i32 {
    let value = i32::from(u16::from_le_bytes(bytes));
    let magnitude = value & (1i32.wrapping_shl(bit).wrapping_sub(1));
    if value.wrapping_shr(bit) & 1 == 1 { magnitude.wrapping_neg() } else { magnitude }
}

/// Encodes steps as a magnitude with the sign in bit 15.
fn steps(value: i32) -> [u8; 2] {
    let sign = if value < 0 { 0x8000 } else { 0 };
    (value.unsigned_abs() as u16 | sign).to_le_bytes()
}

impl Feetech {
    /// Value of [`table::GOAL_POSITION`], within the turn around 0 rad.
    pub fn goal_position(&self, position_rad: f32) -> Option<[u8; 2]> {
        nearest(position_rad / STEP_RAD + CENTRE as f32, 0, 4095).map(steps)
    }

    /// Value of [`table::GOAL_VELOCITY`].
    pub fn goal_velocity(&self, speed_rad_s: f32) -> Option<[u8; 2]> {
        let most = self.model.max_velocity;
        nearest(speed_rad_s / STEP_RAD, most.saturating_neg(), most).map(steps)
    }

    /// Value of [`table::TORQUE_LIMIT`], at least 1, since a limit of 0 would switch torque off.
    pub fn torque_limit(&self, torque_nm: f32) -> Option<[u8; 2]> {
        nearest(torque_nm / self.model.stall_torque_nm * 1000.0, 1, 1000).map(steps)
    }

    /// Register writes that encode an order.
    fn writes(&self, order: &ActuatorCommand) -> Result<Writes, Refusal> {
        super::address(order.id, MAX_ID)?;
        let position = |rad| self.goal_position(rad).ok_or(Refusal::OutOfRange("position"));
        let velocity = |rad_s| self.goal_velocity(rad_s).ok_or(Refusal::OutOfRange("speed"));
        let all = |writes: &[Write]| Vec::from_slice(writes).unwrap_or_default();
        let on = Write::byte(SWITCH, 1);
        Ok(match order.command {
            // Torque off also ends an overload.
            Command::Disable | Command::ClearFaults => all(&[Write::byte(SWITCH, 0)]),
            Command::EnableJoint { measured_rad } => {
                let [p0, p1] = position(measured_rad)?;
                // The servo's own speed limit is as high as the motor allows, because the set-points are limited already.
                let [v0, v1] = steps(self.model.max_velocity);
                all(&[Write { range: MOTION, data: [0, p0, p1, 0, 0, v0, v1] }, on])
            }
            Command::EnableWheel => {
                all(&[Write::byte(ACCELERATION, 0), Write::word(VELOCITY, [0; 2]), on])
            }
            Command::Query => Vec::new(),
            Command::QueryReadings => return Err(Refusal::Unsupported("readings")),
            Command::Limits { speed_rad_s, torque_nm } => {
                // The speed is checked, but not sent, because for a wheel it would be a goal.
                velocity(speed_rad_s)?;
                let limit = self.torque_limit(torque_nm).ok_or(Refusal::OutOfRange("torque"))?;
                all(&[Write::word(LIMIT, limit)])
            }
            Command::Joint(joint) => {
                without(joint.gains, "gains")?;
                without_torque(joint.torque_nm)?;
                all(&[Write::word(POSITION, position(joint.position_rad)?)])
            }
            Command::Wheel(wheel) => {
                without(wheel.kd_nm_s_rad, "kd")?;
                without(wheel.torque_limit_nm, "torque limit in setpoints")?;
                without_torque(wheel.torque_nm)?;
                all(&[Write::word(VELOCITY, velocity(wheel.speed_rad_s)?)])
            }
            Command::Gains(_) => return Err(Refusal::Unsupported("gains")),
            Command::EnableTorque | Command::Torque { .. } => {
                return Err(Refusal::Unsupported("torque"));
            }
        })
    }

    /// Converts an answer to address and feedback.
    pub fn decode(&self, answer: &packet::Answer) -> (u8, Feedback) {
        let [p0, p1, v0, v1, l0, l1, voltage, temperature] = answer.data;
        let position = signed([p0, p1], 15).wrapping_sub(CENTRE);
        let load = signed([l0, l1], 10) as f32 * 1e-3;
        let feedback = Feedback {
            position_rad: Some(position as f32 * STEP_RAD),
            speed_rad_s: Some(signed([v0, v1], 15) as f32 * STEP_RAD),
            torque_nm: Some(load * self.model.stall_torque_nm),
            temperature_c: Some(temperature.into()),
            voltage_v: Some(f32::from(voltage) * VOLTAGE_STEP_V),
            enabled: None,
            faults: Some(Faults::translate(answer.status.into(), &STATUS)),
        };
        (answer.id, feedback)
    }
}

impl Codec for Feetech {
    type Sent = Packet;

    const EXAMPLES: &'static [Self] = &[
        Self { model: table::STS3215_C018, return_delay_us: 0 },
        Self { model: table::STS3250, return_delay_us: 100 },
    ];

    fn name(&self) -> &'static str {
        self.model.name
    }

    fn capabilities(&self) -> Capabilities {
        Capabilities {
            joints: true,
            wheels: true,
            gains: UpdatePolicy::Never,
            max_gains: super::Gains { kp_nm_rad: f32::MAX, kd_nm_s_rad: f32::MAX },
            limits: UpdatePolicy::Stored,
            joint_speed: false,
            torque: false,
            torque_alone: false,
            exact_zero_speed: true,
            answers: Answers::OnQuery,
            measures_position: true,
            measures_torque: true,
            query: true,
            query_readings: false,
            reports_enabled: false,
            pose_while_disabled: true,
            watchdog: Watchdog::Missing,
            max_id: MAX_ID,
        }
    }

    fn emit(&self, order: &ActuatorCommand, send: &mut dyn FnMut(Packet)) -> Result<(), Refusal> {
        self.encode(core::slice::from_ref(order), send).map_err(|(_, refusal)| refusal)
    }

    /// Checks the order without building packets.
    fn check(&self, order: &ActuatorCommand) -> Result<(), Refusal> {
        self.writes(order).map(|_| ())
    }

    /// Encodes orders: a sync write for each range, torque switches before set-points, and finally a sync read.
    fn encode(
        &self,
        orders: &[ActuatorCommand],
        send: &mut dyn FnMut(Packet),
    ) -> Result<(), (usize, Refusal)> {
        for (i, order) in orders.iter().enumerate() {
            self.writes(order).map_err(|refusal| (i, refusal))?;
        }
        for orders in orders.chunks(MAX_ON_LINE) {
            let mut all = Vec::<(u8, Writes), MAX_ON_LINE>::new();
            for order in orders {
                // Checked above, and chunks have at most as many orders as fit.
                let _ = all.push((order.id, self.writes(order).unwrap_or_default()));
            }
            for step in 0..3 {
                for (address, bytes) in RANGES {
                    let mut parameters = Packet::new();
                    let _ = append(&mut parameters, &[address, bytes]);
                    for (id, writes) in &all {
                        if let Some(write) =
                            writes.get(step).filter(|w| w.range == (address, bytes))
                            && let Some(data) = write.data.get(..usize::from(bytes))
                        {
                            let _ = parameters.push(*id);
                            let _ = append(&mut parameters, data);
                        }
                    }
                    to_all(SYNC_WRITE, &parameters).into_iter().for_each(&mut *send);
                }
            }
            let mut parameters = Packet::new();
            let _ = append(&mut parameters, &[table::PRESENT_POSITION, ANSWER_BYTES as u8]);
            for order in orders.iter().filter(|order| order.command == Command::Query) {
                let _ = parameters.push(order.id);
            }
            to_all(SYNC_READ, &parameters).into_iter().for_each(&mut *send);
        }
        Ok(())
    }

    /// Counts the sync writes of joints and wheels, a sync read, and an answer of each servo.
    fn traffic(&self, actuators: u32) -> Traffic {
        // Overhead of a packet with parameters, and of an answer with data.
        const PACKET: u32 = 8;
        const ANSWER: u32 = 6 + ANSWER_BYTES as u32;
        polled(actuators, 3 * PACKET, 3 + 1 + ANSWER, self.return_delay_us)
    }

    fn from_keys(keys: &dyn Keys) -> Self {
        let model = keys.choice("model", &table::MODELS.map(|model| model.name));
        let model = *table::MODELS.get(model).unwrap_or(&STS3215_C001);
        let return_delay_us = keys.integer("return_delay_us", RETURN_DELAYS_US);
        Self { model, return_delay_us }
    }

    fn bit_rates(&self) -> &'static [u32] {
        &table::BIT_RATES
    }

    fn check_settings(&self, report: &mut dyn Report) {
        check_integer(report, "return_delay_us", self.return_delay_us, RETURN_DELAYS_US, " µs");
    }

    fn explain_range(&self, quantity: &'static str, report: &mut dyn FnMut(Arguments<'_>)) {
        match quantity {
            "position" => report(format_args!(
                "give an angle within the turn around 0 rad, {} to \
                {PI} rad",
                -PI
            )),
            "speed" => {
                report(format_args!(
                    "give at most {} rad/s",
                    self.model.max_velocity as f32 * STEP_RAD
                ));
            }
            "torque" => report(format_args!("give at most {} N·m", self.model.stall_torque_nm)),
            _ => {}
        }
    }
}

/// Builds a packet for all servos; `None` if its parameters are only an address and a count.
fn to_all(instruction: u8, parameters: &[u8]) -> Option<Packet> {
    let any = parameters.len() > 2;
    any.then(|| packet::packet(BROADCAST, instruction, parameters)).flatten()
}

impl SerialCodec for Feetech {
    fn receive(&self, buffer: &mut ReceiveBuffer, byte: u8, _: bool) {
        buffer.push(byte);
    }

    fn take(&self, buffer: &mut ReceiveBuffer, is_silent: bool) -> Option<Answer> {
        let (id, feedback) = self.decode(&packet::take(buffer, is_silent)?);
        Some(Answer::Actuator(id, feedback))
    }
}
