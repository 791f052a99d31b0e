//! Axis of an ODrive with CANSimple. Documents: ODrive firmware 0.5.6, `docs/can-protocol.rst` and `controller.cpp`; CAN
//! protocol page of 0.6.10.
//!
//! The axis is never queried. It sends estimates and torques or currents on timers, and its heartbeat every 100 ms. Timers of
//! different axes are not synchronous.

use crate::{DriveCommand, Electronics, Law, Shaft};
use rollwalk_protocol::actuators::bus::Bus;
use rollwalk_protocol::actuators::odrive::{Odrive, Version};
use rollwalk_protocol::can::Frame;
use rollwalk_protocol::config::Channel;
use std::f64::consts::TAU;

/// Heartbeat period as delivered, µs.
const HEARTBEAT_US: u64 = 100_000;
/// Delay between the timers of successive axes, µs.
const STAGGER_US: u64 = 310;
/// Error bit `ESTOP_REQUESTED` of firmware 0.5.
const ESTOP_05: u32 = 0x4000;
/// Error bit `ESTOP_REQUESTED` of firmware 0.6.
const ESTOP_06: u32 = 0x0200_0000;

/// Axis of an ODrive.
#[derive(Clone, Debug)]
pub struct Drive {
    kind: Odrive,
    node: u8,
    /// True in closed-loop control (state 8), false when idle.
    pub closed_loop: bool,
    /// Control mode: 1 torque, 2 velocity, 3 position.
    pub control_mode: u32,
    /// Position gain, (turn/s)/turn; `None` until it is set.
    pub position_gain: Option<f64>,
    /// Velocity gain, N·m/(turn/s) of the motor; `None` until it is set.
    pub velocity_gain: Option<f64>,
    /// Speed limit, turn/s, and current limit, A; `None` until they are set.
    pub limits: Option<(f64, f64)>,
    /// Previous position, speed and torque inputs, at the output. They are kept while idle. Firmware 0.5.6 and later begins
    /// with the measured position instead, which is the easier case.
    pub input: (f64, f64, f64),
    /// Error bits of the axis.
    pub error: u32,
    /// Times, µs, at which the messages of [`Timer::ALL`] are due.
    due_us: [u64; 3],
}

/// Message on a timer.
#[derive(Clone, Copy)]
enum Timer {
    Heartbeat,
    Estimates,
    Torques,
}

impl Timer {
    const ALL: [Self; 3] = [Self::Heartbeat, Self::Estimates, Self::Torques];
}

impl Drive {
    /// Creates the axis of a channel.
    pub fn new(kind: Odrive, _: &Bus, channel: &Channel) -> Self {
        Self {
            kind,
            node: channel.id,
            closed_loop: false,
            control_mode: 3,
            position_gain: None,
            velocity_gain: None,
            limits: None,
            input: (0.0, 0.0, 0.0),
            error: 0,
            due_us: [u64::from(channel.id) * STAGGER_US; 3],
        }
    }

    fn reduction(&self) -> f64 {
        self.kind.reduction.into()
    }

    /// Number of motor turns per rad of the output.
    fn turns_per_rad(&self) -> f64 {
        self.reduction() / TAU
    }

    /// Gains kp and kd at the output, as delivered until they are set.
    fn gains(&self) -> (f64, f64) {
        let per_turn_s = self.velocity_gain.unwrap_or(1.0 / 6.0);
        let kd = per_turn_s * self.reduction() * self.reduction() / TAU;
        (self.position_gain.unwrap_or(20.0) * kd, kd)
    }

    fn command(&self, frame: &Frame) -> Option<u16> {
        let id = frame.standard_id()?;
        (id >> 5 == u16::from(self.node)).then_some(id & 0x1F)
    }

    /// Position, speed and torque of a set-point, at the output; `None` for other commands.
    fn inputs(&self, command: u16, data: &[u8]) -> Option<(f64, f64, f64)> {
        let (turns, nm) = (self.turns_per_rad(), self.reduction());
        let (position, speed, _) = self.input;
        Some(match command {
            0x0C => {
                let thousandths = |i: usize| Some(f64::from(i16_at(data, i)?) / 1000.0);
                (float_at(data, 0)? / turns, thousandths(4)? / turns, thousandths(6)? * nm)
            }
            0x0D => (position, float_at(data, 0)? / turns, float_at(data, 4)? * nm),
            0x0E => (position, speed, float_at(data, 0)? * nm),
            _ => return None,
        })
    }

    fn setpoint(&self, value: f64) -> DriveCommand {
        let ((kp, kd), (_, _, torque_nm)) = (self.gains(), self.input);
        let [value, kp, kd, torque_nm] = [value, kp, kd, torque_nm].map(|x| x as f32);
        DriveCommand::Setpoint { value, kp, kd, torque_nm }
    }

    fn take(&mut self, command: u16, data: &[u8]) -> Option<DriveCommand> {
        Some(match command {
            0x02 => {
                let v05 = self.kind.version == Version::V05;
                self.error |= if v05 { ESTOP_05 } else { ESTOP_06 };
                self.closed_loop = false;
                DriveCommand::Disable
            }
            0x07 => match u32_at(data, 0)? {
                1 => {
                    self.closed_loop = false;
                    DriveCommand::Disable
                }
                8 => {
                    self.closed_loop = self.error == 0;
                    DriveCommand::Enable
                }
                _ => return None,
            },
            0x0B => {
                // Input mode 1 passes set-points unchanged; ramps and filters are not simulated.
                let (mode, 1) = (u32_at(data, 0)?, u32_at(data, 4)?) else { return None };
                self.control_mode = mode;
                DriveCommand::Mode
            }
            0x0C => {
                self.input = self.inputs(command, data)?;
                self.setpoint(self.input.0)
            }
            0x0D => {
                self.input = self.inputs(command, data)?;
                self.setpoint(self.input.1)
            }
            0x0E => {
                self.input = self.inputs(command, data)?;
                DriveCommand::Torque(self.input.2 as f32)
            }
            0x0F => {
                let limits = (float_at(data, 0)?, float_at(data, 4)?);
                if limits.0 < 0.0 || limits.1 < 0.0 {
                    return None;
                }
                self.limits = Some(limits);
                DriveCommand::Limits
            }
            0x18 => {
                self.error = 0;
                DriveCommand::ClearFaults
            }
            0x1A => {
                self.position_gain = Some(float_at(data, 0)?);
                DriveCommand::PositionGain
            }
            0x1B => {
                // Integral gains are not simulated.
                let (gain, 0.0) = (float_at(data, 0)?, float_at(data, 4)?) else { return None };
                self.velocity_gain = Some(gain);
                let (kp, kd) = self.gains();
                DriveCommand::Gains { kp: kp as f32, kd: kd as f32 }
            }
            _ => return None,
        })
    }

    fn period_us(&self, timer: Timer) -> u64 {
        match timer {
            Timer::Heartbeat => HEARTBEAT_US,
            Timer::Estimates | Timer::Torques => {
                1_000_000 / u64::from(self.kind.estimates_hz.max(1))
            }
        }
    }

    fn answer(&self, timer: Timer, shaft: &Shaft) -> Frame {
        let two = |a: f64, b: f64| {
            let [a, b] = [a, b].map(|x| (x as f32).to_le_bytes());
            [a, b].concat()
        };
        let motor_nm = if self.closed_loop { shaft.torque_nm / self.reduction() } else { 0.0 };
        let (command, data) = match timer {
            Timer::Heartbeat => {
                let [a, b, c, d] = self.error.to_le_bytes();
                let state = if self.closed_loop { 8 } else { 1 };
                (0x01, vec![a, b, c, d, state, 0, 0, 0])
            }
            Timer::Estimates => {
                let turns = self.turns_per_rad();
                (0x09, two(shaft.position_rad * turns, shaft.speed_rad_s * turns))
            }
            Timer::Torques if self.kind.version == Version::V06 => (0x1C, two(motor_nm, motor_nm)),
            Timer::Torques => {
                let current_a = motor_nm / f64::from(self.kind.torque_constant_nm_a);
                (0x14, two(current_a, current_a))
            }
        };
        let id = u16::from(self.node) << 5 | command;
        Frame::standard(id, &data).expect("an identifier of 11 bits and 8 bytes")
    }
}

impl Electronics for Drive {
    fn remember(&mut self, stale: Law) {
        self.input = (stale.position_rad, stale.speed_rad_s, stale.torque_nm);
    }

    /// Processes a frame. Frames that are too short count as [`DriveCommand::Odd`].
    fn on_frame(
        &mut self,
        _: u64,
        frame: &Frame,
        _: &Shaft,
    ) -> Option<(DriveCommand, Option<Frame>)> {
        let (command, data) = (self.command(frame)?, frame.data());
        // Messages that drives send.
        if matches!(command, 0x01 | 0x03 | 0x09 | 0x14 | 0x15 | 0x1C) {
            return None;
        }
        Some((self.take(command, data).unwrap_or(DriveCommand::Odd), None))
    }

    fn commanded(&self, frame: &Frame) -> Option<f32> {
        let command = self.command(frame)?;
        let (position_rad, speed_rad_s, _) = self.inputs(command, frame.data())?;
        match command {
            0x0C => Some(position_rad as f32),
            0x0D => Some(speed_rad_s as f32),
            _ => None,
        }
    }

    fn next_timer_us(&self) -> Option<u64> {
        self.due_us.into_iter().min()
    }

    fn on_timer(&mut self, now_us: u64, shaft: &Shaft) -> Option<Frame> {
        let index = self.due_us.iter().position(|due| *due <= now_us)?;
        let timer = Timer::ALL[index];
        // After a pause, one message is late, and missed messages are not sent.
        let (due, period) = (self.due_us[index], self.period_us(timer));
        self.due_us[index] = due + ((now_us - due) / period + 1) * period;
        Some(self.answer(timer, shaft))
    }

    /// Control law: torque = g_v (g_p (q* − q) + q̇* − q̇) + τ. Both the commanded speed and the torque are limited.
    fn law(&self, shaft: &Shaft) -> Option<Law> {
        if !self.closed_loop {
            return None;
        }
        let (position_rad, speed_rad_s, torque_nm) = self.input;
        let (kp, kd) = self.gains();
        let (max_turns_s, max_a) = self.limits.unwrap_or((f64::INFINITY, f64::INFINITY));
        let torque_constant: f64 = self.kind.torque_constant_nm_a.into();
        let torque_limit_nm = max_a * torque_constant * self.reduction().abs();
        let torque = Law { torque_nm, torque_limit_nm, ..Law::default() };
        if self.control_mode == 1 {
            return Some(torque);
        }
        let fastest = (max_turns_s / self.turns_per_rad()).abs();
        let speed = Law { kd_nm_s_rad: kd, ..torque };
        if self.control_mode == 2 {
            let speed_rad_s = speed_rad_s.clamp(-fastest, fastest);
            return Some(Law { speed_rad_s, ..speed });
        }
        let asked = kp / kd * (position_rad - shaft.position_rad) + speed_rad_s;
        Some(if asked.abs() > fastest {
            Law { speed_rad_s: fastest.copysign(asked), ..speed }
        } else {
            Law { position_rad, speed_rad_s, kp_nm_rad: kp, ..speed }
        })
    }
}

fn bytes_at<const N: usize>(data: &[u8], at: usize) -> Option<[u8; N]> {
    data.get(at..at + N)?.try_into().ok()
}

fn float_at(data: &[u8], at: usize) -> Option<f64> {
    let value = f32::from_le_bytes(bytes_at(data, at)?);
    value.is_finite().then_some(value.into())
}

fn u32_at(data: &[u8], at: usize) -> Option<u32> {
    bytes_at(data, at).map(u32::from_le_bytes)
}

fn i16_at(data: &[u8], at: usize) -> Option<i16> {
    bytes_at(data, at).map(i16::from_le_bytes)
}
