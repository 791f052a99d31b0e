//! Dynamixel servo of the X series: the simulated subset of its control table. Documents: e-Manual pages `dxl/protocol2`,
//! `x/xm430-w210`, `x/xm540-w150`.
//!
//! The operating mode is 0 if the controller closes the loop, 1 for wheels, 5 for joints, and 3 for joints of servos without a
//! current sensor. The manual has no gains in N·m, so the servo uses the gains of the robot file.

use crate::{Answer, DriveCommand, Electronics, Law, Shaft, is_wheel};
use rollwalk_protocol::actuators::bus::{Bus, ControlLoop};
use rollwalk_protocol::actuators::dynamixel::Dynamixel;
use rollwalk_protocol::config::Channel;
use std::f64::consts::TAU;

/// Position step, rad.
const RAD: f64 = TAU / 4096.0;
/// Velocity step, rad/s.
const RAD_S: f64 = 0.229 * TAU / 60.0;
/// Position in the middle of a turn, steps.
const CENTRE: i32 = 2048;
/// Reported temperature, °C.
const TEMPERATURE_C: u8 = 35;
/// Step of the bus watchdog, µs.
const WATCHDOG_US: u64 = 20_000;

/// Header of every packet.
const HEADER: [u8; 4] = [0xFF, 0xFF, 0xFD, 0];
/// Bytes of the header that stuffing keeps out of the rest of a packet.
const STUFFED: &[u8] = &[0xFF, 0xFF, 0xFD];
/// Broadcast address.
const ALL: u8 = 0xFE;
const STATUS: u8 = 0x55;
/// Number of bytes of a packet up to its length field.
const HEAD: usize = 7;
/// Limit of the length of a packet, bytes. Longer ones are rejected.
const LONGEST: usize = 1024;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Mode {
    Current,
    Velocity,
    CurrentBasedPosition,
    Position,
}

/// Dynamixel servo.
#[derive(Clone, Debug)]
pub struct Drive {
    kind: Dynamixel,
    id: u8,
    mode: Mode,
    gains: (f64, f64),
    enabled: bool,
    /// Goal position, steps; 2048 is 0 rad. Kept while torque is off.
    pub goal_position: i32,
    /// Goal velocity, steps. Kept while torque is off.
    pub goal_velocity: i32,
    /// Goal current, steps: the goal in mode 0, the limit in mode 5.
    pub goal_current: i16,
    /// Timeout of the watchdog, steps of 20 ms; 0 for no watchdog.
    watchdog_20ms: u8,
    expired: bool,
    /// Time of the previous packet for this servo, µs.
    fed_us: u64,
}

impl Drive {
    /// Creates the servo of a channel.
    pub fn new(kind: Dynamixel, bus: &Bus, channel: &Channel) -> Self {
        let mode = match bus.control {
            ControlLoop::OnController => Mode::Current,
            ControlLoop::InDrive if is_wheel(channel) => Mode::Velocity,
            ControlLoop::InDrive if kind.model.has_current() => Mode::CurrentBasedPosition,
            ControlLoop::InDrive => Mode::Position,
        };
        let most = i16::try_from(kind.model.max_current).unwrap_or(i16::MAX);
        Self {
            kind,
            id: channel.id,
            mode,
            gains: (channel.kp_nm_rad.into(), channel.kd_nm_s_rad.into()),
            enabled: false,
            goal_position: CENTRE,
            goal_velocity: 0,
            goal_current: if mode == Mode::Current { 0 } else { most },
            watchdog_20ms: 0,
            expired: false,
            fed_us: 0,
        }
    }

    fn read(&self, address: u16, count: usize, shaft: &Shaft) -> Option<Vec<u8>> {
        match (address, count) {
            (126, 10) => Some(self.measurements(shaft)),
            (144, 3) => Some([&self.supply_tenths().to_le_bytes()[..], &[TEMPERATURE_C]].concat()),
            _ => None,
        }
    }

    /// Recommended supply voltage, 0.1 V.
    fn supply_tenths(&self) -> u16 {
        (self.kind.model.supply_v() * 10.0).round() as u16
    }

    /// Current, velocity and position.
    fn measurements(&self, shaft: &Shaft) -> Vec<u8> {
        let torque_nm = if self.enabled { shaft.torque_nm } else { 0.0 };
        // Servos without a current sensor report their load.
        let current = torque_nm / self.torque_step_nm();
        let steps = |value: f64| value.round() as i32;
        let mut data = Vec::new();
        data.extend((steps(current) as i16).to_le_bytes());
        data.extend(steps(shaft.speed_rad_s / RAD_S).to_le_bytes());
        data.extend((steps(shaft.position_rad / RAD) + CENTRE).to_le_bytes());
        data
    }

    /// Answer to a query of `of` servos, after the answers of `turn` others. `data` contains the requested values.
    fn answer(&self, is_fast: bool, (turn, of): (usize, usize), data: &[u8]) -> Answer {
        let delay_us = self.kind.return_delay_us.into();
        // Error is 0 in both formats.
        if !is_fast {
            let bytes = wrapped(self.id, &[&[STATUS, 0], data].concat());
            return Answer { bytes, turn, delay_us, is_part: false };
        }
        let part = [&[0, self.id], data].concat();
        if turn > 0 {
            return Answer { bytes: part, turn, delay_us: 0, is_part: true };
        }
        // The header precedes all parts. Each part ends with a checksum of two bytes.
        let [low, high] = (1 + of as u16 * (part.len() as u16 + 2)).to_le_bytes();
        let bytes = [&HEADER[..], &[ALL, low, high, STATUS], &part].concat();
        Answer { bytes, turn, delay_us, is_part: true }
    }

    fn write(&mut self, now_us: u64, address: u16, data: &[u8]) -> Option<DriveCommand> {
        let word = || Some(i16::from_le_bytes(data.try_into().ok()?));
        let long = || Some(i32::from_le_bytes(data.try_into().ok()?));
        // After a timeout of the watchdog, goals cannot be written.
        if self.expired && address >= 100 {
            return None;
        }
        Some(match address {
            64 => {
                self.enabled = data == [1];
                if self.enabled { DriveCommand::Enable } else { DriveCommand::Disable }
            }
            98 => {
                self.watchdog_20ms = *data.first()?;
                self.expired &= self.watchdog_20ms != 0;
                self.fed_us = now_us;
                DriveCommand::Watchdog
            }
            102 if self.kind.model.has_current() => {
                self.goal_current = word()?;
                match self.mode {
                    Mode::Current => DriveCommand::Torque(self.goal_torque_nm() as f32),
                    _ => DriveCommand::Limits,
                }
            }
            104 => {
                self.goal_velocity = long()?;
                self.setpoint()
            }
            112 => {
                long()?;
                DriveCommand::Limits
            }
            116 => {
                self.goal_position = long()?;
                self.setpoint()
            }
            _ => return None,
        })
    }

    fn torque_step_nm(&self) -> f64 {
        self.kind.model.torque_step_nm.into()
    }

    fn goal_torque_nm(&self) -> f64 {
        f64::from(self.goal_current) * self.torque_step_nm()
    }

    fn setpoint(&self) -> DriveCommand {
        self.goal().setpoint(self.mode == Mode::Velocity)
    }

    fn goal(&self) -> Law {
        let (kp_nm_rad, kd_nm_s_rad) = self.gains;
        let limited = Law { torque_limit_nm: self.goal_torque_nm().abs(), ..Law::default() };
        match self.mode {
            Mode::Current => {
                let torque_nm = self.goal_torque_nm();
                Law { torque_nm, torque_limit_nm: f64::INFINITY, ..limited }
            }
            Mode::Velocity => {
                let speed_rad_s = f64::from(self.goal_velocity) * RAD_S;
                Law { speed_rad_s, kd_nm_s_rad, torque_limit_nm: f64::INFINITY, ..limited }
            }
            Mode::CurrentBasedPosition | Mode::Position => {
                let position_rad = f64::from(self.goal_position.saturating_sub(CENTRE)) * RAD;
                let torque_limit_nm = match self.mode {
                    Mode::Position => f64::INFINITY,
                    _ => limited.torque_limit_nm,
                };
                Law { position_rad, kp_nm_rad, kd_nm_s_rad, torque_limit_nm, ..limited }
            }
        }
    }
}

impl Electronics for Drive {
    fn remember(&mut self, stale: Law) {
        self.goal_position = CENTRE + (stale.position_rad / RAD) as i32;
        self.goal_velocity = (stale.speed_rad_s / RAD_S) as i32;
        self.goal_current = (stale.torque_nm / self.torque_step_nm()) as i16;
    }

    /// Processes sync writes and sync reads, which address all servos.
    fn on_packet(
        &mut self,
        now_us: u64,
        bytes: &[u8],
        shaft: &Shaft,
    ) -> (Vec<DriveCommand>, Option<Answer>) {
        let nothing = (vec![], None);
        let Some(told) = unwrapped(bytes) else { return nothing };
        let &[instruction, a0, a1, n0, n1, ref rest @ ..] = &told[..] else { return nothing };
        let (address, count) =
            (u16::from_le_bytes([a0, a1]), usize::from(u16::from_le_bytes([n0, n1])));
        match instruction {
            0x82 | 0x8A => {
                // Servos answer in the order of the request.
                let Some(turn) = rest.iter().position(|&id| id == self.id) else { return nothing };
                self.fed_us = now_us;
                let data = self.read(address, count, shaft);
                let turns = (turn, rest.len());
                let said = data.map(|data| self.answer(instruction == 0x8A, turns, &data));
                (vec![DriveCommand::Query], said)
            }
            0x83 => {
                let Some([_, mine @ ..]) = rest.chunks(1 + count).find(|chunk| chunk[0] == self.id)
                else {
                    return nothing;
                };
                self.fed_us = now_us;
                (vec![self.write(now_us, address, mine).unwrap_or(DriveCommand::Odd)], None)
            }
            _ => nothing,
        }
    }

    /// Removes the next packet. After a wrong CRC the search for a header continues at the second byte.
    fn take_packet(&self, line: &mut Vec<u8>) -> Option<Vec<u8>> {
        loop {
            let begins = |at: &usize| line[*at..].iter().zip(HEADER).all(|(&a, b)| a == b);
            line.drain(..(0..line.len()).find(begins).unwrap_or(line.len()));
            let &[_, _, _, _, _, low, high, ..] = &line[..] else { return None };
            let whole = HEAD + usize::from(u16::from_le_bytes([low, high]));
            if whole > LONGEST {
                line.remove(0);
                continue;
            }
            let packet = line.get(..whole)?;
            if let Some((body, crc)) = packet.split_last_chunk()
                && crc16(body) == u16::from_le_bytes(*crc)
            {
                return Some(line.drain(..whole).collect());
            }
            line.remove(0);
        }
    }

    /// Checks the watchdog. An expired watchdog stops the servo until 0 is written to it.
    fn on_time(&mut self, now_us: u64) {
        let patience_us = u64::from(self.watchdog_20ms) * WATCHDOG_US;
        self.expired |= patience_us > 0 && now_us.saturating_sub(self.fed_us) > patience_us;
    }

    fn law(&self, _: &Shaft) -> Option<Law> {
        (self.enabled && !self.expired).then(|| self.goal())
    }
}

/// Instruction and parameters of a broadcast packet; `None` if the packet is incomplete or damaged.
fn unwrapped(bytes: &[u8]) -> Option<Vec<u8>> {
    let (body, crc) = bytes.split_last_chunk()?;
    let &[low, high, ref stuffed @ ..] = body.strip_prefix(&HEADER)?.strip_prefix(&[ALL])? else {
        return None;
    };
    // The length counts the bytes after its field, CRC included.
    let whole = usize::from(u16::from_le_bytes([low, high])) == stuffed.len() + crc.len();
    if !whole || crc16(body) != u16::from_le_bytes(*crc) {
        return None;
    }
    let mut plain = Vec::new();
    let mut bytes = stuffed.iter();
    while let Some(&byte) = bytes.next() {
        plain.push(byte);
        if plain.ends_with(STUFFED) && bytes.next() != Some(&0xFD) {
            return None;
        }
    }
    Some(plain)
}

/// Packet of an answer: adds header, stuffing and CRC to instruction and parameters.
fn wrapped(id: u8, plain: &[u8]) -> Vec<u8> {
    let mut stuffed = Vec::new();
    for &byte in plain {
        stuffed.push(byte);
        if stuffed.ends_with(STUFFED) {
            stuffed.push(0xFD);
        }
    }
    let [low, high] = (stuffed.len() as u16 + 2).to_le_bytes();
    let body = [&HEADER[..], &[id, low, high], &stuffed].concat();
    let crc = crc16(&body).to_le_bytes();
    [&body[..], &crc].concat()
}

/// CRC of the page `dxl/crc`: polynomial 0x8005, most significant bit first, initial value 0.
pub(crate) fn crc16(bytes: &[u8]) -> u16 {
    let mut crc = 0u16;
    for byte in bytes {
        crc ^= u16::from(*byte) << 8;
        for _ in 0..8 {
            let carry = crc & 0x8000 != 0;
            crc <<= 1;
            if carry {
                crc ^= 0x8005;
            }
        }
    }
    crc
}
