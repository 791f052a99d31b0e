//! Mini cheetah drives and T-Motor's AK series in MIT mode. Documents: bgkatz/motorcontrol, CubeMars "AK Series Actuator Driver
//! Manual V1.0.8".

use crate::scale::{code, share, value};
use crate::{DriveCommand, Electronics, Law, Shaft, is_wheel};
use rollwalk_protocol::actuators::bus::Bus;
use rollwalk_protocol::actuators::mit::{AnswerId, Mit};
use rollwalk_protocol::can::Frame;
use rollwalk_protocol::config::Channel;

const POSITION_RAD: f64 = 12.5;
const KP_NM_RAD: f64 = 500.0;
const KD_NM_S_RAD: f64 = 5.0;
/// Temperature reported by an AK drive, °C.
const TEMPERATURE_C: u8 = 30;

/// Drive in MIT mode.
#[derive(Clone, Debug)]
pub struct Drive {
    model: Mit,
    id: u8,
    is_wheel: bool,
    enabled: bool,
    /// Previous set-point, which the drive keeps while torque is off.
    pub last: Law,
    /// Reported error, in AK drives only.
    pub error: u8,
}

impl Drive {
    /// Creates the drive of a channel.
    pub fn new(model: Mit, _: &Bus, channel: &Channel) -> Self {
        let (id, is_wheel) = (channel.id, is_wheel(channel));
        Self { model, id, is_wheel, enabled: false, last: Law::default(), error: 0 }
    }

    fn max_speed_rad_s(&self) -> f64 {
        self.model.model.max_speed_rad_s.into()
    }

    fn max_torque_nm(&self) -> f64 {
        self.model.model.max_torque_nm.into()
    }

    /// Payload of a frame; `None` unless it has eight bytes and addresses this drive.
    fn mine(&self, frame: &Frame) -> Option<[u8; 8]> {
        (frame.standard_id() == Some(self.id.into())).then(|| frame.data().try_into().ok())?
    }

    fn setpoint(&self, data: [u8; 8]) -> Law {
        let bits = u64::from_be_bytes(data);
        let field = |shift: u32, width: u32| (bits >> shift) as u32 & ((1 << width) - 1);
        Law {
            position_rad: value(field(48, 16), POSITION_RAD, 16),
            speed_rad_s: value(field(36, 12), self.max_speed_rad_s(), 12),
            kp_nm_rad: share(field(24, 12), 12) * KP_NM_RAD,
            kd_nm_s_rad: share(field(12, 12), 12) * KD_NM_S_RAD,
            torque_nm: value(field(0, 12), self.max_torque_nm(), 12),
            torque_limit_nm: self.max_torque_nm(),
        }
    }

    fn answer(&self, shaft: &Shaft) -> Frame {
        let torque_nm = if self.enabled { shaft.torque_nm } else { 0.0 };
        let p = code(shaft.position_rad, POSITION_RAD, 16);
        let v = code(shaft.speed_rad_s, self.max_speed_rad_s(), 12);
        let t = code(torque_nm, self.max_torque_nm(), 12);
        let low = (v << 4) as u8 | (t >> 8) as u8;
        let six = [self.id, (p >> 8) as u8, p as u8, (v >> 4) as u8, low, t as u8];
        let frame = match self.model.answers_from {
            AnswerId::Master(master) => Frame::standard(master, &six),
            AnswerId::Own => {
                Frame::standard(self.id.into(), &[&six[..], &[TEMPERATURE_C, self.error]].concat())
            }
        };
        frame.expect("an identifier of 11 bits and at most 8 bytes")
    }
}

impl Electronics for Drive {
    fn on_frame(
        &mut self,
        _: u64,
        frame: &Frame,
        shaft: &Shaft,
    ) -> Option<(DriveCommand, Option<Frame>)> {
        let data = self.mine(frame)?;
        let sent = match special(&data) {
            // The motor follows the last set-point.
            Some(0xFC) => {
                self.enabled = true;
                DriveCommand::Enable
            }
            Some(0xFD) => {
                self.enabled = false;
                DriveCommand::Disable
            }
            // Rollwalk never sends the command for a new zero.
            Some(_) => DriveCommand::Odd,
            None => {
                self.last = self.setpoint(data);
                self.last.setpoint(self.is_wheel)
            }
        };
        Some((sent, Some(self.answer(shaft))))
    }

    fn commanded(&self, frame: &Frame) -> Option<f32> {
        let data = self.mine(frame).filter(|data| special(data).is_none())?;
        Some(self.setpoint(data).value(self.is_wheel))
    }

    fn law(&self, _: &Shaft) -> Option<Law> {
        self.enabled.then_some(self.last)
    }

    fn remember(&mut self, stale: Law) {
        self.last = stale;
    }
}

/// Last byte of a command; `None` for a set-point.
fn special(data: &[u8; 8]) -> Option<u8> {
    let [head @ .., last] = data;
    (*head == [0xFF; 7] && (0xFC..=0xFE).contains(last)).then_some(*last)
}
