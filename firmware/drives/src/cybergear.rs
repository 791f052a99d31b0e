//! Xiaomi CyberGear motor. Document: "CyberGear micro motor instruction manual", section 4.
//!
//! Only run mode 0, operation control, is simulated. In any other mode the motor gives no torque.

use crate::scale::{code, share, value};
use crate::{DriveCommand, Electronics, Law, Shaft, is_wheel};
use rollwalk_protocol::actuators::bus::Bus;
use rollwalk_protocol::actuators::cybergear::CyberGear;
use rollwalk_protocol::can::Frame;
use rollwalk_protocol::config::Channel;

const SPEED_RAD_S: f64 = 30.0;
const TORQUE_NM: f64 = 12.0;
const KP_NM_RAD: f64 = 500.0;
const KD_NM_S_RAD: f64 = 5.0;
/// Reported temperature, tenths of a °C.
const TEMPERATURE: u32 = 250;

/// Writable parameter: run mode.
const RUN_MODE: u16 = 0x7005;
/// Writable parameter: torque limit.
const LIMIT_TORQUE: u16 = 0x700B;
/// Writable parameter: speed limit.
const LIMIT_SPEED: u16 = 0x7017;

/// CyberGear motor.
#[derive(Clone, Debug)]
pub struct Drive {
    kind: CyberGear,
    id: u8,
    is_wheel: bool,
    enabled: bool,
    /// Run mode; 0 is operation control.
    pub mode: u8,
    /// Previous set-point, which the motor keeps while torque is off.
    pub last: Law,
    torque_limit_nm: f64,
    /// Fault bits of the motor.
    pub faults: u8,
}

impl Drive {
    /// Creates the motor of a channel.
    pub fn new(kind: CyberGear, _: &Bus, channel: &Channel) -> Self {
        Self {
            kind,
            id: channel.id,
            is_wheel: is_wheel(channel),
            enabled: false,
            mode: 0,
            last: Law::default(),
            torque_limit_nm: TORQUE_NM,
            faults: 0,
        }
    }

    /// Type, data and payload of a frame; `None` unless the frame addresses this motor.
    fn mine(&self, frame: &Frame) -> Option<(u8, u16, [u8; 8])> {
        let id = frame.extended_id()?;
        let (kind, data16, target) = ((id >> 24) as u8, (id >> 8) as u16, id as u8);
        // In motors' frames this field is a master's number, or the motor's own number.
        let command = target == self.id && !matches!(kind, 2 | 21);
        command.then(|| Some((kind, data16, frame.data().try_into().ok()?)))?
    }

    fn setpoint(&self, torque: u16, data: [u8; 8]) -> Law {
        let word = |i: usize| u32::from(u16::from_be_bytes([data[i], data[i + 1]]));
        Law {
            position_rad: value(word(0), self.kind.max_position_rad.into(), 16),
            speed_rad_s: value(word(2), SPEED_RAD_S, 16),
            kp_nm_rad: share(word(4), 16) * KP_NM_RAD,
            kd_nm_s_rad: share(word(6), 16) * KD_NM_S_RAD,
            torque_nm: value(torque.into(), TORQUE_NM, 16),
            torque_limit_nm: f64::INFINITY,
        }
    }

    fn write(&mut self, [i0, i1, _, _, value @ ..]: [u8; 8]) -> DriveCommand {
        match u16::from_le_bytes([i0, i1]) {
            // The mode cannot change while the motor runs.
            RUN_MODE if !self.enabled => {
                self.mode = value[0];
                DriveCommand::Mode
            }
            LIMIT_TORQUE => {
                // The manual's range is 0 to 12 N·m.
                let limit_nm = f64::from(f32::from_le_bytes(value));
                if !(0.0..=TORQUE_NM).contains(&limit_nm) {
                    return DriveCommand::Odd;
                }
                self.torque_limit_nm = limit_nm;
                DriveCommand::Limits
            }
            // Limit of the position mode, which is not simulated.
            LIMIT_SPEED => DriveCommand::Limits,
            _ => DriveCommand::Odd,
        }
    }

    /// Answer to every command.
    pub fn feedback(&self, shaft: &Shaft) -> Frame {
        let mode = if self.enabled { 2u32 } else { 0 };
        let id = 2 << 24
            | mode << 22
            | u32::from(self.faults) << 16
            | u32::from(self.id) << 8
            | u32::from(self.kind.host);
        let torque_nm = if self.enabled { shaft.torque_nm } else { 0.0 };
        let words = [
            code(shaft.position_rad, self.kind.max_position_rad.into(), 16),
            code(shaft.speed_rad_s, SPEED_RAD_S, 16),
            code(torque_nm, TORQUE_NM, 16),
            TEMPERATURE,
        ];
        let bytes: Vec<u8> = words.iter().flat_map(|&word| (word as u16).to_be_bytes()).collect();
        Frame::extended(id, &bytes).expect("an identifier of 29 bits and 8 bytes")
    }
}

impl Electronics for Drive {
    fn on_frame(
        &mut self,
        _: u64,
        frame: &Frame,
        shaft: &Shaft,
    ) -> Option<(DriveCommand, Option<Frame>)> {
        let (kind, data16, data) = self.mine(frame)?;
        let sent = match kind {
            1 => {
                self.last = self.setpoint(data16, data);
                self.last.setpoint(self.is_wheel)
            }
            3 => {
                self.enabled = true;
                DriveCommand::Enable
            }
            4 => {
                self.enabled = false;
                if data[0] == 1 {
                    self.faults = 0;
                    DriveCommand::ClearFaults
                } else {
                    DriveCommand::Disable
                }
            }
            18 => self.write(data),
            _ => return Some((DriveCommand::Odd, None)),
        };
        Some((sent, Some(self.feedback(shaft))))
    }

    fn commanded(&self, frame: &Frame) -> Option<f32> {
        let (1, data16, data) = self.mine(frame)? else { return None };
        Some(self.setpoint(data16, data).value(self.is_wheel))
    }

    fn law(&self, _: &Shaft) -> Option<Law> {
        let runs = self.enabled && self.mode == 0;
        runs.then_some(Law { torque_limit_nm: self.torque_limit_nm, ..self.last })
    }

    fn remember(&mut self, stale: Law) {
        (self.mode, self.last) = (3, stale);
    }
}
