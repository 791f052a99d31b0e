//! Servo or wheel drive of the Rollwalk profile.
//!
//! The servo follows the law of the profile ([`rollwalk_protocol::actuator`]) with the gains of the latest set-point. It
//! answers every frame that addresses it with feedback at the end of that frame. If set-points stop, its watchdog switches
//! torque off until the servo is disabled and enabled again.

use crate::{DriveCommand, Electronics, Law, Shaft, is_wheel};
use rollwalk_protocol::actuator::{
    ActuatorStatus, Control, Feedback, JointSetpoint, WheelSetpoint,
};
use rollwalk_protocol::can::Frame;
use rollwalk_protocol::config::Channel;
use std::f64::consts::PI;

/// Time without a set-point after which an enabled servo switches torque off, µs.
pub const WATCHDOG_US: u64 = 100_000;

/// State of the servo.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Mode {
    Disabled,
    /// Enabled; no torque until the first set-point.
    Waiting,
    Following(Law),
    TimedOut,
}

/// Servo of the Rollwalk profile.
#[derive(Clone, Debug)]
pub struct Drive {
    is_wheel: bool,
    id: u8,
    mode: Mode,
    /// Time at which the servo was enabled or received its latest set-point, µs.
    fed_us: u64,
    counter: u8,
}

impl Drive {
    /// Creates the servo of a channel.
    pub fn new(channel: &Channel) -> Self {
        let (is_wheel, id) = (is_wheel(channel), channel.id);
        Self { is_wheel, id, mode: Mode::Disabled, fed_us: 0, counter: 0 }
    }

    /// Control law of a set-point for this servo; `None` for any other frame.
    fn law_of(&self, frame: &Frame) -> Option<Law> {
        let (id, law) = if self.is_wheel {
            let (id, setpoint) = WheelSetpoint::decode(frame)?;
            let law = Law {
                speed_rad_s: setpoint.speed_rad_s.into(),
                kd_nm_s_rad: setpoint.kd_nm_s_rad.into(),
                torque_nm: setpoint.torque_nm.into(),
                torque_limit_nm: setpoint.torque_limit_nm.into(),
                ..Law::default()
            };
            (id, law)
        } else {
            let (id, setpoint) = JointSetpoint::decode(frame)?;
            let law = Law {
                position_rad: setpoint.position_rad.into(),
                speed_rad_s: setpoint.velocity_rad_s.into(),
                kp_nm_rad: setpoint.kp_nm_rad.into(),
                kd_nm_s_rad: setpoint.kd_nm_s_rad.into(),
                torque_nm: setpoint.torque_nm.into(),
                torque_limit_nm: f64::INFINITY,
            };
            (id, law)
        };
        (id == self.id).then_some(law)
    }

    fn feedback(&mut self, shaft: &Shaft) -> Feedback {
        self.counter = self.counter.wrapping_add(1);
        let position_rad = if self.is_wheel {
            (shaft.position_rad + PI).rem_euclid(2.0 * PI) - PI
        } else {
            shaft.position_rad
        };
        let driving = matches!(self.mode, Mode::Following(_));
        let mut status = match self.mode {
            Mode::Disabled => 0,
            Mode::Waiting | Mode::Following(_) => ActuatorStatus::ENABLED,
            Mode::TimedOut => ActuatorStatus::TIMED_OUT,
        };
        if driving && shaft.torque_limited {
            status |= ActuatorStatus::TORQUE_LIMITED;
        }
        Feedback {
            position_rad: position_rad as f32,
            velocity_rad_s: shaft.speed_rad_s as f32,
            torque_nm: if driving { shaft.torque_nm as f32 } else { 0.0 },
            status: ActuatorStatus(status),
            counter: self.counter,
        }
    }
}

impl Electronics for Drive {
    fn on_frame(
        &mut self,
        now_us: u64,
        frame: &Frame,
        shaft: &Shaft,
    ) -> Option<(DriveCommand, Option<Frame>)> {
        let sent = if let Some((id, control)) = Control::decode(frame) {
            if id != self.id {
                return None;
            }
            match (control, self.mode) {
                (Control::Disable, _) => self.mode = Mode::Disabled,
                (Control::Enable, Mode::Disabled) => {
                    self.mode = Mode::Waiting;
                    self.fed_us = now_us;
                }
                (Control::Enable | Control::Query, _) => {}
            }
            match control {
                Control::Disable => DriveCommand::Disable,
                Control::Enable => DriveCommand::Enable,
                Control::Query => DriveCommand::Query,
            }
        } else {
            let law = self.law_of(frame)?;
            if matches!(self.mode, Mode::Waiting | Mode::Following(_)) {
                self.mode = Mode::Following(law);
                self.fed_us = now_us;
            }
            law.setpoint(self.is_wheel)
        };
        Some((sent, Some(self.feedback(shaft).encode(self.id)?)))
    }

    fn commanded(&self, frame: &Frame) -> Option<f32> {
        Some(self.law_of(frame)?.value(self.is_wheel))
    }

    fn on_time(&mut self, now_us: u64) {
        let enabled = matches!(self.mode, Mode::Waiting | Mode::Following(_));
        if enabled && now_us.saturating_sub(self.fed_us) > WATCHDOG_US {
            self.mode = Mode::TimedOut;
        }
    }

    fn law(&self, _: &Shaft) -> Option<Law> {
        match self.mode {
            Mode::Following(law) => Some(law),
            Mode::Disabled | Mode::Waiting | Mode::TimedOut => None,
        }
    }
}
