//! Dynamixel servos of the X series, Protocol 2.0, on a half-duplex serial line.
//!
//! Documents: e-Manual pages `dxl/protocol2`, `dxl/crc`, and those of the servos ([`table`]). One sync write carries all
//! commands of one kind. One sync read carries all queries, and the servos answer it one after the other.

use core::f32::consts::TAU;
use core::fmt::Arguments;
use core::ops::RangeInclusive;

use heapless::Vec;
use serde::{Deserialize, Serialize};

use super::fixed::nearest;
use super::named;
use super::serial::{Answer, MAX_ON_LINE, ReceiveBuffer};
use super::settings::{Keys, Report, check_integer, or};
use super::traffic::polled;
use super::{
    ActuatorCommand, Answers, Capabilities, Codec, Command, Faults, Feedback, Packet, Refusal,
    SerialCodec, Traffic, UpdatePolicy, Watchdog, without, without_torque,
};
use crate::packet::append;

pub mod packet;
pub mod table;

use packet::{
    BROADCAST, FAST_SYNC_READ, MAX_ID, MAX_PARTS, Message, PART_BYTES, Part, ReceivedPacket,
    SYNC_READ, SYNC_WRITE,
};
use table::{CENTRE, Model, STEPS_PER_TURN, VELOCITY_STEP_RAD_S, VOLTAGE_STEP_V, XM430_W210};

/// Servos of one model on a line.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(from = "Encoded", into = "Encoded")]
pub struct Dynamixel {
    /// Model of the servos.
    pub model: Model,
    /// Bus watchdog while torque is on, in steps of 20 ms: 1 to 127, or 0 for no watchdog.
    pub watchdog_20ms: u8,
    /// Return delay of the servos ("Return Delay Time"), µs; 500 µs as delivered.
    pub return_delay_us: u32,
    /// True to read with [`FAST_SYNC_READ`], which up to [`MAX_PARTS`] servos answer in one packet. Fast reads
    /// require firmware 45 or later; an XL330 requires 46.
    pub reads_fast: bool,
}

/// Encoding of [`Dynamixel`]. The highest bit of `return_delay_us` is `reads_fast`; delays never reach it. Servos without fast
/// reads keep their previous encoding, which the hash of a robot's configuration covers.
#[derive(Clone, Copy, Serialize, Deserialize)]
#[serde(rename = "Dynamixel")]
struct Encoded {
    #[serde(with = "named")]
    model: Model,
    watchdog_20ms: u8,
    return_delay_us: u32,
}

const READS_FAST: u32 = 1 << 31;

impl From<Dynamixel> for Encoded {
    fn from(servos: Dynamixel) -> Self {
        let Dynamixel { model, watchdog_20ms, return_delay_us, reads_fast } = servos;
        let fast = if reads_fast { READS_FAST } else { 0 };
        Self { model, watchdog_20ms, return_delay_us: return_delay_us | fast }
    }
}

impl From<Encoded> for Dynamixel {
    fn from(encoded: Encoded) -> Self {
        let Encoded { model, watchdog_20ms, return_delay_us } = encoded;
        Self {
            model,
            watchdog_20ms,
            return_delay_us: return_delay_us & !READS_FAST,
            reads_fast: return_delay_us & READS_FAST != 0,
        }
    }
}

/// Bit of an answer's error byte that reports a hardware error.
const ALERT: u8 = 0x80;
/// Maximum size of the parameters of a sync write, bytes. The longest one writes gains.
const MAX_WRITE: usize = 4 + MAX_ON_LINE * 7;
/// Step of the bus watchdog, ms.
const WATCHDOG_STEP_MS: u32 = 20;
/// Range of the bus watchdog, ms: up to 127 steps.
const WATCHDOGS_MS: RangeInclusive<u32> = 0..=127 * WATCHDOG_STEP_MS;
/// Range of Return Delay Time, µs: up to 254 steps of 2 µs.
const RETURN_DELAYS_US: RangeInclusive<u32> = 0..=508;
/// Size of current, velocity and position, bytes.
const PRESENT_BYTES: u16 = PART_BYTES as u16;
/// Size of input voltage and temperature, bytes.
const READINGS_BYTES: u16 = 3;

/// Write of one address range of many servos in one packet.
#[derive(Clone, Debug)]
pub struct SyncWrite {
    parameters: Vec<u8, MAX_WRITE>,
    bytes: u16,
}

impl SyncWrite {
    /// Creates a write without servos. Each servo that is added receives `bytes` bytes, from register `address` upwards.
    pub fn new(address: u16, bytes: u16) -> Self {
        let mut parameters = Vec::new();
        let _ = append(&mut parameters, &address.to_le_bytes());
        let _ = append(&mut parameters, &bytes.to_le_bytes());
        Self { parameters, bytes }
    }

    /// Adds the data of a servo. Returns false and changes nothing if `data` does not have the length given to [`Self::new`],
    /// if the packet is full, or if `id` is not an address.
    #[must_use]
    pub fn push(&mut self, id: u8, data: &[u8]) -> bool {
        let room = self.parameters.capacity().saturating_sub(self.parameters.len()) > data.len();
        let fits = id <= MAX_ID && data.len() == usize::from(self.bytes) && room;
        fits && self.parameters.push(id).is_ok() && append(&mut self.parameters, data).is_some()
    }

    /// Builds the packet; `None` if there is no data.
    pub fn packet(&self) -> Option<Packet> {
        let any = self.parameters.len() > 4;
        any.then(|| packet::packet(BROADCAST, SYNC_WRITE, &self.parameters)).flatten()
    }
}

/// Builds a read of `bytes` bytes from `address` up, for the servos `ids`. They answer in this order. `None` if `ids` is empty
/// or does not fit in a packet.
pub fn sync_read(address: u16, bytes: u16, ids: &[u8]) -> Option<Packet> {
    read_all(SYNC_READ, address, bytes, ids)
}

/// Builds a read like [`sync_read`], which the servos answer in one packet.
pub fn fast_sync_read(address: u16, bytes: u16, ids: &[u8]) -> Option<Packet> {
    read_all(FAST_SYNC_READ, address, bytes, ids)
}

fn read_all(instruction: u8, address: u16, bytes: u16, ids: &[u8]) -> Option<Packet> {
    let mut parameters = Vec::<u8, MAX_WRITE>::new();
    append(&mut parameters, &address.to_le_bytes())?;
    append(&mut parameters, &bytes.to_le_bytes())?;
    append(&mut parameters, ids)?;
    (!ids.is_empty()).then(|| packet::packet(BROADCAST, instruction, &parameters)).flatten()
}

/// Addresses of the servos that receive `command`, which has no values.
fn addressed(orders: &[ActuatorCommand], command: Command) -> Vec<u8, MAX_ON_LINE> {
    let mut ids = Vec::new();
    for order in orders.iter().filter(|order| order.command == command) {
        let _ = ids.push(order.id);
    }
    ids
}

/// Gains of the position controller in the servo's units: D, I, P, from [`table::POSITION_D_GAIN`] up. `None` if a gain is
/// above [`table::MAX_GAIN`].
pub fn position_gains(p: u16, i: u16, d: u16) -> Option<[u8; 6]> {
    let [[d0, d1], [i0, i1], [p0, p1]] = [d, i, p].map(u16::to_le_bytes);
    let fits = [p, i, d].iter().all(|&gain| gain <= table::MAX_GAIN);
    fits.then_some([d0, d1, i0, i1, p0, p1])
}

/// Largest multiple of 0.01 that is not above a positive value, for messages.
fn hundredths_below(value: f32) -> f32 {
    (value * 100.0) as u32 as f32 / 100.0
}

/// Value of [`table::GOAL_PWM`] for `share`, a fraction of the supply voltage from −1 to 1.
pub fn goal_pwm(share: f32) -> Option<[u8; 2]> {
    nearest(share / table::PWM_STEP, -table::MAX_PWM, table::MAX_PWM)
        .map(|steps| (steps as i16).to_le_bytes())
}

impl Dynamixel {
    /// Value of [`table::GOAL_POSITION`]: at most 256 turns in either direction. The position mode accepts only the turn around
    /// 0 rad.
    pub fn goal_position(&self, position_rad: f32) -> Option<[u8; 4]> {
        let steps = position_rad * STEPS_PER_TURN / TAU + CENTRE as f32;
        nearest(steps, -1_048_575, 1_048_575).map(i32::to_le_bytes)
    }

    /// Value of [`table::GOAL_VELOCITY`].
    pub fn goal_velocity(&self, speed_rad_s: f32) -> Option<[u8; 4]> {
        let most = self.model.max_velocity;
        nearest(speed_rad_s / VELOCITY_STEP_RAD_S, most.saturating_neg(), most)
            .map(i32::to_le_bytes)
    }

    /// Largest torque that a goal current can express, N·m.
    pub fn goal_current_max_nm(&self) -> f32 {
        self.model.max_current as f32 * self.model.torque_step_nm
    }

    /// Value of [`table::GOAL_CURRENT`].
    pub fn goal_current(&self, torque_nm: f32) -> Option<[u8; 2]> {
        let most = self.model.max_current;
        nearest(torque_nm / self.model.torque_step_nm, most.saturating_neg(), most)
            .map(|steps| (steps as i16).to_le_bytes())
    }

    /// Decodes address and feedback of an answer; `None` for other messages. The feedback contains faults, and after a query
    /// measurements.
    pub fn decode(&self, received: &Message) -> Option<(u8, Feedback)> {
        let status = received.status()?;
        let error = status.error | if status.alert { ALERT } else { 0 };
        Some((status.id, self.feedback(error, status.data)))
    }

    /// Decodes address and feedback of one part of a combined answer.
    pub fn decode_part(&self, part: &Part) -> (u8, Feedback) {
        (part.id, self.feedback(part.error, &part.data))
    }

    fn feedback(&self, error: u8, data: &[u8]) -> Feedback {
        let faults = Some(faults_of(error & ALERT != 0, error & !ALERT));
        let mut feedback = Feedback { faults, ..Feedback::default() };
        if let &[c0, c1, v0, v1, v2, v3, p0, p1, p2, p3] = data {
            let current = f32::from(i16::from_le_bytes([c0, c1]));
            let velocity = i32::from_le_bytes([v0, v1, v2, v3]);
            let position = i32::from_le_bytes([p0, p1, p2, p3]).wrapping_sub(CENTRE);
            feedback.torque_nm = Some(current * self.model.torque_step_nm);
            feedback.speed_rad_s = Some(velocity as f32 * VELOCITY_STEP_RAD_S);
            feedback.position_rad = Some(position as f32 * (TAU / STEPS_PER_TURN));
        }
        if let &[v0, v1, temperature] = data {
            feedback.voltage_v = Some(f32::from(u16::from_le_bytes([v0, v1])) * VOLTAGE_STEP_V);
            feedback.temperature_c = Some(temperature.into());
        }
        feedback
    }

    /// Register writes that encode an order.
    fn writes(&self, order: &ActuatorCommand) -> Result<Writes, Refusal> {
        super::address(order.id, MAX_ID)?;
        let position = |rad| self.goal_position(rad).ok_or(Refusal::OutOfRange("position"));
        let velocity = |rad_s| self.goal_velocity(rad_s).ok_or(Refusal::OutOfRange("speed"));
        let enable = |address, goal| {
            // An expired watchdog must be cleared before goals can be written. The goal is written before torque is switched
            // on.
            Vec::from_array([
                Write::byte(table::BUS_WATCHDOG, 0),
                Write { address, data: goal },
                Write::byte(table::TORQUE_ENABLE, 1),
                Write::byte(table::BUS_WATCHDOG, self.watchdog_20ms.min(127)),
            ])
        };
        let one = |address, data| {
            let mut writes = Vec::new();
            let _ = writes.push(Write { address, data });
            writes
        };
        Ok(match order.command {
            Command::Disable => one(table::TORQUE_ENABLE, [0; 4]),
            Command::ClearFaults => one(table::BUS_WATCHDOG, [0; 4]),
            Command::EnableJoint { measured_rad } => {
                enable(table::GOAL_POSITION, position(measured_rad)?)
            }
            Command::EnableWheel => enable(table::GOAL_VELOCITY, [0; 4]),
            Command::EnableTorque | Command::Torque { .. } | Command::Limits { .. }
                if !self.model.has_current() =>
            {
                return Err(Refusal::Unsupported("torque"));
            }
            Command::EnableTorque => enable(table::GOAL_CURRENT, [0; 4]),
            Command::Torque { torque_nm } => {
                let goal = self.goal_current(torque_nm).ok_or(Refusal::OutOfRange("torque"))?;
                let [t0, t1] = goal;
                one(table::GOAL_CURRENT, [t0, t1, 0, 0])
            }
            Command::Query | Command::QueryReadings => Vec::new(),
            Command::Gains(_) => return Err(Refusal::Unsupported("gains")),
            Command::Limits { speed_rad_s, torque_nm } => {
                let positive = |x: f32| x > 0.0;
                let speed = velocity(speed_rad_s)?;
                // 0 steps would mean no limit.
                if !positive(speed_rad_s) || speed == [0; 4] {
                    return Err(Refusal::OutOfRange("speed"));
                }
                let torque = self.goal_current(torque_nm).filter(|_| positive(torque_nm));
                let [t0, t1] = torque.ok_or(Refusal::OutOfRange("torque"))?;
                let mut writes = one(table::GOAL_CURRENT, [t0, t1, 0, 0]);
                let _ = writes.push(Write { address: table::PROFILE_VELOCITY, data: speed });
                writes
            }
            Command::Joint(joint) => {
                without(joint.gains, "gains")?;
                without_torque(joint.torque_nm)?;
                one(table::GOAL_POSITION, position(joint.position_rad)?)
            }
            Command::Wheel(wheel) => {
                without(wheel.kd_nm_s_rad, "kd")?;
                without(wheel.torque_limit_nm, "torque limit in setpoints")?;
                without_torque(wheel.torque_nm)?;
                one(table::GOAL_VELOCITY, velocity(wheel.speed_rad_s)?)
            }
        })
    }
}

/// Value for an address of [`RANGES`]. The range there defines how many of the bytes are sent.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Write {
    address: u16,
    data: [u8; 4],
}

/// Register writes of an order, in sequence.
type Writes = Vec<Write, 4>;

impl Write {
    fn byte(address: u16, byte: u8) -> Self {
        Self { address, data: [byte, 0, 0, 0] }
    }
}

/// Faults in the error byte of an answer.
fn faults_of(alert: bool, error: u8) -> Faults {
    let alert = if alert { Faults::OTHER.0 } else { 0 };
    Faults(alert | if error != 0 { Faults::REFUSED.0 } else { 0 })
}

impl Codec for Dynamixel {
    type Sent = Packet;

    const EXAMPLES: &'static [Self] = &[
        Self { model: table::XM540_W150, watchdog_20ms: 5, return_delay_us: 0, reads_fast: false },
        Self { model: table::XL430_W250, watchdog_20ms: 5, return_delay_us: 20, reads_fast: false },
        Self { model: table::XH540_W150, watchdog_20ms: 5, return_delay_us: 20, reads_fast: true },
    ];

    fn name(&self) -> &'static str {
        self.model.name
    }

    fn capabilities(&self) -> Capabilities {
        let current = self.model.has_current();
        Capabilities {
            joints: true,
            wheels: true,
            gains: UpdatePolicy::Never,
            max_gains: super::Gains { kp_nm_rad: f32::MAX, kd_nm_s_rad: f32::MAX },
            // Without a current sensor there is no torque to limit.
            limits: if current { UpdatePolicy::Stored } else { UpdatePolicy::Never },
            joint_speed: false,
            torque: false,
            torque_alone: current,
            exact_zero_speed: true,
            answers: Answers::OnQuery,
            measures_position: true,
            measures_torque: true,
            query: true,
            query_readings: true,
            reports_enabled: false,
            pose_while_disabled: true,
            watchdog: Watchdog::Latches,
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

    /// Encodes orders: a sync write for each address range, torque switches before set-points, and finally sync reads. One
    /// packet carries the set-points of all servos, so they begin together.
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
            for step in 0..4 {
                for (address, bytes) in RANGES {
                    let mut sync = SyncWrite::new(address, bytes);
                    for (id, writes) in &all {
                        if let Some(write) = writes.get(step).filter(|w| w.address == address)
                            && let Some(data) = write.data.get(..usize::from(bytes))
                        {
                            let _ = sync.push(*id, data);
                        }
                    }
                    sync.packet().into_iter().for_each(&mut *send);
                }
            }
            let asked = addressed(orders, Command::Query);
            let is_fast = self.reads_fast && asked.len() <= MAX_PARTS;
            let instruction = if is_fast { FAST_SYNC_READ } else { SYNC_READ };
            let read = read_all(instruction, table::PRESENT_CURRENT, PRESENT_BYTES, &asked);
            read.into_iter().for_each(&mut *send);
            // Parts of a fast answer always have the size of the present values.
            let asked = addressed(orders, Command::QueryReadings);
            let read = sync_read(table::PRESENT_INPUT_VOLTAGE, READINGS_BYTES, &asked);
            read.into_iter().for_each(&mut *send);
        }
        Ok(())
    }

    /// Counts a sync write of goals, a sync read, and an answer of each servo, with the maximum byte stuffing. Answers to a
    /// fast read have no stuffing.
    fn traffic(&self, actuators: u32) -> Traffic {
        const fn packet(parameters: u32) -> u32 {
            10 + parameters + parameters / 3
        }
        // Stuffing adds at most a third of the 4 + 5 n and 4 + n parameters. Rounded down separately, both thirds add up to at
        // most 2 + 2 n.
        const ONCE: u32 = 2 * (10 + 4) + 2;
        const EACH: u32 = 5 + 1 + 2 + packet(1 + PRESENT_BYTES as u32);
        if self.reads_fast && actuators <= MAX_PARTS as u32 {
            // One header, no stuffing, one delay.
            let bytes = polled(actuators, ONCE + 8, 5 + 1 + 2 + PART_BYTES as u32 + 4, 0);
            return Traffic { waiting_us_per_period: self.return_delay_us, ..bytes };
        }
        polled(actuators, ONCE, EACH, self.return_delay_us)
    }

    fn from_keys(keys: &dyn Keys) -> Self {
        let model = keys.choice("model", &table::MODELS.map(|model| model.name));
        let model = *table::MODELS.get(model).unwrap_or(&XM430_W210);
        let watchdog_ms = keys.integer("watchdog_ms", WATCHDOGS_MS);
        if !watchdog_ms.is_multiple_of(WATCHDOG_STEP_MS) {
            let help = "give a multiple of 20 ms, or 0 for no watchdog";
            keys.refuse("watchdog_ms", "is not a multiple of 20 ms", "not a multiple of 20", help);
        }
        let watchdog_20ms = (watchdog_ms / WATCHDOG_STEP_MS) as u8;
        let return_delay_us = keys.integer("return_delay_us", RETURN_DELAYS_US);
        let reads_fast = or(keys, "read", false, |key| keys.choice(key, &["sync", "fast"]) == 1);
        Self { model, watchdog_20ms, return_delay_us, reads_fast }
    }

    fn bit_rates(&self) -> &'static [u32] {
        &table::BIT_RATES
    }

    fn check_settings(&self, report: &mut dyn Report) {
        let watchdog_ms = u32::from(self.watchdog_20ms) * WATCHDOG_STEP_MS;
        check_integer(report, "watchdog_ms", watchdog_ms, WATCHDOGS_MS, " ms");
        check_integer(report, "return_delay_us", self.return_delay_us, RETURN_DELAYS_US, " µs");
    }

    fn explain_range(&self, quantity: &'static str, report: &mut dyn FnMut(Arguments<'_>)) {
        match quantity {
            "speed" => {
                let most = self.model.max_velocity as f32 * VELOCITY_STEP_RAD_S;
                report(format_args!("give at most {} rad/s", hundredths_below(most)));
            }
            "torque" if self.model.has_current() => {
                let most = hundredths_below(self.goal_current_max_nm());
                report(format_args!("give at most {most} N·m"));
            }
            _ => {}
        }
    }
}

impl SerialCodec for Dynamixel {
    fn receive(&self, buffer: &mut ReceiveBuffer, byte: u8, _: bool) {
        buffer.push(byte);
    }

    fn take(&self, buffer: &mut ReceiveBuffer, is_silent: bool) -> Option<Answer> {
        loop {
            let told = match packet::next(buffer, is_silent, self.reads_fast)? {
                ReceivedPacket::Part(part) => Some(self.decode_part(&part)),
                // Our own packets come back on a half-duplex line.
                ReceivedPacket::Message(message) => self.decode(&message),
            };
            if let Some((id, feedback)) = told {
                return Some(Answer::Actuator(id, feedback));
            }
        }
    }
}

/// Address ranges that [`Dynamixel::encode`] writes, most urgent first.
const RANGES: [(u16, u16); 6] = [
    (table::TORQUE_ENABLE, 1),
    (table::BUS_WATCHDOG, 1),
    (table::GOAL_CURRENT, 2),
    (table::PROFILE_VELOCITY, 4),
    (table::GOAL_POSITION, 4),
    (table::GOAL_VELOCITY, 4),
];
