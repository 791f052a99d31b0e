//! Feetech STS servo: the simulated subset of its memory table. Documents: Feetech, "Communication Protocol User Manual" and
//! "Magnetic Encoder STS Servo, Memory Table Analysis".
//!
//! The operating mode is 0 (position) for joints and 1 (constant speed) for wheels. The servo has no watchdog: it keeps
//! following the previous command. The manual has no gains in N·m, so the servo uses the gains of the robot file.

use crate::{Answer, DriveCommand, Electronics, Law, Shaft, is_wheel};
use rollwalk_protocol::actuators::bus::Bus;
use rollwalk_protocol::actuators::feetech::Feetech;
use rollwalk_protocol::config::Channel;
use std::f64::consts::TAU;

/// Position step, rad; also the velocity step, rad/s.
const STEP: f64 = TAU / 4096.0;
/// Position in the middle of a turn, steps.
const CENTRE: f64 = 2048.0;
/// Broadcast address.
const ALL: u8 = 0xFE;
/// Instruction codes in the manual.
const INSTRUCTIONS: [u8; 12] = [1, 2, 3, 4, 5, 6, 8, 9, 10, 11, 0x82, 0x83];
/// Reported temperature, °C, without faults.
const TEMPERATURE_C: u8 = 35;

/// Feetech servo.
#[derive(Clone, Debug)]
pub struct Drive {
    kind: Feetech,
    id: u8,
    is_wheel: bool,
    gains: (f64, f64),
    enabled: bool,
    /// Goal position, steps. Kept while torque is off.
    goal_position: f64,
    /// Goal velocity of a wheel or largest velocity of a joint, steps/s.
    goal_velocity: f64,
    /// Torque limit, fraction of the stall torque.
    torque_limit: f64,
    /// Status byte of every answer.
    pub status: u8,
}

impl Drive {
    /// Creates the servo of a channel.
    pub fn new(kind: Feetech, _: &Bus, channel: &Channel) -> Self {
        Self {
            kind,
            id: channel.id,
            is_wheel: is_wheel(channel),
            gains: (channel.kp_nm_rad.into(), channel.kd_nm_s_rad.into()),
            enabled: false,
            goal_position: CENTRE,
            goal_velocity: 0.0,
            torque_limit: 1.0,
            status: 0,
        }
    }

    /// Writes bytes, the first to `address`; `None` unless they form valid values of complete registers.
    fn write(&mut self, address: u8, data: &[u8]) -> Option<Vec<DriveCommand>> {
        let word = |low: u8, high: u8| magnitude(u16::from_le_bytes([low, high]), 15);
        Some(match (address, data) {
            (40, [switch @ 0..=1]) => {
                self.enabled = *switch == 1;
                vec![if self.enabled { DriveCommand::Enable } else { DriveCommand::Disable }]
            }
            // Every joint gets the maximum acceleration; with another, it would lag behind its set-points.
            (41, [0]) => vec![DriveCommand::Limits],
            (41, [0, p0, p1, _, _, v0, v1]) => {
                self.goal_velocity = word(*v0, *v1);
                self.goal_position = word(*p0, *p1);
                vec![DriveCommand::Limits, self.goal().setpoint(self.is_wheel)]
            }
            (42, [p0, p1]) if !self.is_wheel => {
                self.goal_position = word(*p0, *p1);
                vec![self.goal().setpoint(false)]
            }
            (46, [v0, v1]) => {
                self.goal_velocity = word(*v0, *v1);
                let setpoint = self.goal().setpoint(true);
                vec![if self.is_wheel { setpoint } else { DriveCommand::Limits }]
            }
            (48, [l0, l1]) if word(*l0, *l1) >= 0.0 && word(*l0, *l1) <= 1000.0 => {
                self.torque_limit = word(*l0, *l1) / 1000.0;
                vec![DriveCommand::Limits]
            }
            _ => return None,
        })
    }

    fn read(&self, address: u8, count: u8, shaft: &Shaft) -> Option<Vec<u8>> {
        if (address, count) != (56, 8) {
            return None;
        }
        let torque_nm = if self.enabled { shaft.torque_nm } else { 0.0 };
        let load = torque_nm / self.stall_torque_nm() * 1000.0;
        // The position is within a turn, because the servo counts no turns.
        let position = (shaft.position_rad / STEP + CENTRE).round().rem_euclid(4096.0);
        let words = [(position, 15), (shaft.speed_rad_s / STEP, 15), (load, 10)];
        let mut data = vec![self.status];
        data.extend(words.iter().flat_map(|&(value, bit)| with_sign(value, bit).to_le_bytes()));
        data.extend([(self.kind.model.supply_v * 10.0).round() as u8, TEMPERATURE_C]);
        Some(wrapped(self.id, &data))
    }

    fn stall_torque_nm(&self) -> f64 {
        self.kind.model.stall_torque_nm.into()
    }

    fn goal(&self) -> Law {
        let (kp_nm_rad, kd_nm_s_rad) = self.gains;
        let torque_limit_nm = self.torque_limit * self.stall_torque_nm();
        let law = Law { kd_nm_s_rad, torque_limit_nm, ..Law::default() };
        if self.is_wheel {
            Law { speed_rad_s: self.goal_velocity * STEP, ..law }
        } else {
            Law { position_rad: (self.goal_position - CENTRE) * STEP, kp_nm_rad, ..law }
        }
    }
}

impl Electronics for Drive {
    fn remember(&mut self, stale: Law) {
        self.goal_position = CENTRE + (stale.position_rad / STEP).round();
        self.goal_velocity = (stale.speed_rad_s / STEP).round();
    }

    /// Processes sync writes and sync reads, which address all servos.
    fn on_packet(
        &mut self,
        _: u64,
        bytes: &[u8],
        shaft: &Shaft,
    ) -> (Vec<DriveCommand>, Option<Answer>) {
        let nothing = (vec![], None);
        let Some(&[ALL, _, instruction, address, count, ref rest @ ..]) = unwrapped(bytes) else {
            return nothing;
        };
        match instruction {
            0x82 => {
                let Some(turn) = rest.iter().position(|&id| id == self.id) else { return nothing };
                let delay_us = self.kind.return_delay_us.into();
                let said = self.read(address, count, shaft);
                (
                    vec![DriveCommand::Query],
                    said.map(|bytes| Answer { bytes, turn, delay_us, is_part: false }),
                )
            }
            0x83 => {
                let mut chunks = rest.chunks(1 + usize::from(count));
                let Some([_, mine @ ..]) = chunks.find(|chunk| chunk[0] == self.id) else {
                    return nothing;
                };
                (self.write(address, mine).unwrap_or_else(|| vec![DriveCommand::Odd]), None)
            }
            _ => nothing,
        }
    }

    /// Removes the next packet. The manual does not specify what a servo does with an incomplete packet. The simulated servo
    /// waits for the rest only if the instruction is in the manual.
    fn take_packet(&self, line: &mut Vec<u8>) -> Option<Vec<u8>> {
        loop {
            let begin = line.windows(2).position(|two| two == [0xFF, 0xFF]);
            // The last byte may be the first byte of a header.
            line.drain(..begin.unwrap_or(line.len().saturating_sub(1)));
            let &[_, _, id, length, instruction, ..] = &line[..] else { return None };
            let whole = usize::from(length) + 4;
            // The third of three 0xFF is the second byte of a header.
            let begins = id <= ALL && INSTRUCTIONS.contains(&instruction);
            if begins && unwrapped(line.get(..whole)?).is_some() {
                return Some(line.drain(..whole).collect());
            }
            line.remove(0);
        }
    }

    fn law(&self, _: &Shaft) -> Option<Law> {
        self.enabled.then(|| self.goal())
    }
}

/// Decodes a magnitude whose sign is in `bit`.
fn magnitude(value: u16, bit: u32) -> f64 {
    let size = f64::from(value & ((1 << bit) - 1));
    if value & 1 << bit == 0 { size } else { -size }
}

fn with_sign(value: f64, bit: u32) -> u16 {
    let largest = f64::from((1u32 << bit) - 1);
    let size = value.round().abs().min(largest) as u16;
    if value < 0.0 { size | 1 << bit } else { size }
}

/// Content between header and checksum of a complete packet; `None` for any other bytes.
fn unwrapped(bytes: &[u8]) -> Option<&[u8]> {
    let (sum, body) = bytes.strip_prefix(&[0xFF, 0xFF])?.split_last()?;
    let whole = usize::from(*body.get(1)?) + 1 == body.len();
    (whole && *sum == complement(body)).then_some(body)
}

/// Packet of an answer: adds header, address, length and checksum to status and data.
fn wrapped(id: u8, data: &[u8]) -> Vec<u8> {
    let body = [&[id, data.len() as u8 + 1], data].concat();
    [&[0xFF, 0xFF], &body[..], &[complement(&body)]].concat()
}

/// Checksum of the manual: complement of the sum.
pub(crate) fn complement(bytes: &[u8]) -> u8 {
    let sum: u32 = bytes.iter().map(|&byte| u32::from(byte)).sum();
    (sum as u8) ^ 0xFF
}
