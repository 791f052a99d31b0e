//! The Rollwalk servo profile: frames between the controller and its servos and wheel drives.
//!
//! | id | frame | direction |
//! |---|---|---|
//! | `0x080 + n` | [`Control`]: enable, disable | to actuator `n` |
//! | `0x100 + n` | [`JointSetpoint`] | to actuator `n` |
//! | `0x180 + n` | [`Feedback`] | from actuator `n` |
//! | `0x200 + n` | [`WheelSetpoint`] | to actuator `n` |
//! | `0x280 + n` | [`JointSetpoint`] with a torque | to actuator `n` |
//! | `0x300 + n` | [`WheelSetpoint`] with a torque | to actuator `n` |
//! | `0x380 + n` | [`JointSetpoint`], wide | to actuator `n` |
//! | `0x400 + n` | [`WheelSetpoint`], wide | to actuator `n` |
//! | `0x480 + n` | [`Feedback`], wide | from actuator `n` |
//!
//! `n` is 0 to 127. [`Control`] frames have priority over set-points on a busy bus. Integers are little-endian and two's
//! complement. Values are rounded to the nearest step, and 0 is encoded exactly. The code −32768 is never sent, and is refused
//! on receipt.
//!
//! A value beyond its scale is not sent: `encode` returns `None`. This cannot happen within the limits of a configuration that
//! passed [`crate::config::RobotConfig::check`].
//!
//! A set-point whose torque rounds to 0 is sent in the frame without torque. Drives without torque input can then follow it.
//! Values beyond the scale of the other frames are sent in a wide frame, which fast wheels and large robots need.

mod codes;

use crate::can::Frame;
use codes::{
    COARSE_SPEED_STEPS, DOWN, KD_STEPS, KP_STEPS, NEAREST, SHORT_KD_STEPS, SHORT_KP_STEPS,
    SHORT_MOST, SHORT_TORQUE_STEPS, WHEEL_SPEED_STEPS, WIDER, from_short, i16_steps, short,
    short_torque, signed_short, steps, u16_steps, unsigned,
};

pub(crate) use codes::{
    POSITION_STEPS, SPEED_STEPS, TORQUE_STEPS, from_measurement, measured, measurement, saturated,
    signed,
};

/// Largest address of an actuator.
pub const MAX_ID: u8 = 0x7F;
/// Position step in rad: 0.2 mrad. Codes span ±6.5534 rad, a little more than a turn.
pub const POSITION_STEP_RAD: f32 = 1.0 / POSITION_STEPS;
/// Largest position, rad.
pub const MAX_POSITION_RAD: f32 = 6.5;
/// Speed step of 16-bit codes in rad/s: 2 mrad/s. Codes span ±65.534 rad/s.
pub const SPEED_STEP_RAD_S: f32 = 1.0 / SPEED_STEPS;
/// Largest speed of a joint, rad/s.
pub const MAX_SPEED_RAD_S: f32 = 65.0;
/// Largest speed of a wheel, rad/s.
pub const MAX_WHEEL_SPEED_RAD_S: f32 = 1000.0;
/// Speed step of wheel set-points in rad/s: 0.1 mrad/s, in 32-bit codes. Decoded values encode to the same bytes up to 2²²
/// steps, ±419 rad/s. Above that, an `f32` may be off by a step.
pub const WHEEL_SPEED_STEP_RAD_S: f32 = 1.0 / WHEEL_SPEED_STEPS;
/// Torque step in N·m: 5 mN·m. Codes span ±163.8 N·m, or 0 to 327 N·m for a limit.
pub const TORQUE_STEP_NM: f32 = 1.0 / TORQUE_STEPS;
/// Largest torque, N·m.
pub const MAX_TORQUE_NM: f32 = 20_000.0;
/// Step of the proportional gain, N·m/rad: 0.01.
pub const KP_STEP_NM_RAD: f32 = 1.0 / KP_STEPS;
/// Largest proportional gain, N·m/rad.
pub const MAX_KP_NM_RAD: f32 = 65_000.0;
/// Step of the damping gain, N·m·s/rad: 0.001.
pub const KD_STEP_NM_S_RAD: f32 = 1.0 / KD_STEPS;
/// Largest damping gain, N·m·s/rad.
pub const MAX_KD_NM_S_RAD: f32 = 5000.0;

const CONTROL: u16 = 0x080;
const JOINT_SETPOINT: u16 = 0x100;
const FEEDBACK: u16 = 0x180;
const WHEEL_SETPOINT: u16 = 0x200;
/// Set-points of joints with torque, and wide.
const JOINT_TORQUE_SETPOINTS: [u16; 2] = [0x280, 0x380];
/// Set-points of wheels with torque, and wide.
const WHEEL_TORQUE_SETPOINTS: [u16; 2] = [0x300, 0x400];
const WIDE_FEEDBACK: u16 = 0x480;

fn address(base: u16, id: u8) -> Option<u16> {
    (id <= MAX_ID).then(|| base | u16::from(id))
}

/// Address and payload of a frame of kind `base` with exactly `N` bytes.
fn split<const N: usize>(frame: &Frame, base: u16) -> Option<(u8, [u8; N])> {
    let id = frame.standard_id()?;
    let of_kind = id & !u16::from(MAX_ID) == base;
    let data = frame.data().try_into().ok()?;
    of_kind.then_some(((id & u16::from(MAX_ID)) as u8, data))
}

/// Encodes a set-point with torque: `low` in the lowest 30 bits, then short codes of `first`, kd and torque. The frame is wide if
/// the torque is 0, or if a value exceeds the scale. `first` returns the code of the first value, with steps that are wider by
/// the given ratio.
fn torque_frame(
    id: u8,
    [narrow, wide]: [u16; 2],
    low: u64,
    first: &dyn Fn(f32) -> Option<u64>,
    (kd_nm_s_rad, torque_nm): (f32, f32),
) -> Option<Frame> {
    let word = |wider: f32| {
        let kd = short(kd_nm_s_rad, SHORT_KD_STEPS / wider, NEAREST)?;
        let torque = short_torque(torque_nm, SHORT_TORQUE_STEPS / wider)?;
        Some(low | first(wider)? << 30 | kd << 41 | torque << 52)
    };
    let (base, word) = match word(1.0).filter(|&word| has_torque(word)) {
        Some(word) => (narrow, word),
        None => (wide, word(WIDER)?),
    };
    Some(Frame::known(address(base, id)?, word.to_le_bytes()))
}

/// Least short code of a wide frame that does not fit a frame with torque: 2¹⁸ steps.
const LEAST_WIDE: u64 = 12 << 7;
/// Least short codes of kp or kd, and of a torque limit, that do not fit a frame without torque. They stand for 655.36 N·m/rad,
/// 65.536 N·m·s/rad and 327.68 N·m.
const LEAST_WIDE_GAIN: u64 = 9 << 7 | 32;
const LEAST_WIDE_LIMIT: u64 = 8 << 7 | 32;

/// Address and word of a set-point with torque, and the ratio of its steps to those of a narrow frame. `None` for a frame that is
/// never sent: narrow with a torque of 0, wide with values that fit another frame, or with a torque of −0. `least` is the least
/// first code of a wide frame without torque.
fn torque_word(frame: &Frame, [narrow, wide]: [u16; 2], least: u64) -> Option<(u8, u64, f32)> {
    let (id, bytes, wider) = match split(frame, narrow) {
        Some((id, bytes)) => (id, bytes, 1.0),
        None => split(frame, wide).map(|(id, bytes)| (id, bytes, WIDER))?,
    };
    let word = u64::from_le_bytes(bytes);
    let code = |at: u32| (word >> at) & u64::from(SHORT_MOST);
    let is_sent = if wider == 1.0 {
        has_torque(word)
    } else if has_torque(word) {
        [30, 41, 52].into_iter().any(|at| code(at) >= LEAST_WIDE)
    } else {
        word >> 63 == 0 && (code(30) >= least || code(41) >= LEAST_WIDE_GAIN)
    };
    is_sent.then_some((id, word, wider))
}

/// True if the torque in the highest 12 bits is not 0.
fn has_torque(word: u64) -> bool {
    word >> 52 & u64::from(SHORT_MOST) != 0
}

/// Set-point of a joint's servo: torque = kp (q* − q) + kd (q̇* − q̇) + τ, limited by the servo.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct JointSetpoint {
    /// q*, rad.
    pub position_rad: f32,
    /// q̇*, rad/s.
    pub velocity_rad_s: f32,
    /// kp, N·m/rad.
    pub kp_nm_rad: f32,
    /// kd, N·m·s/rad.
    pub kd_nm_s_rad: f32,
    /// τ, N·m.
    pub torque_nm: f32,
}

impl JointSetpoint {
    /// Encodes the set-point in a frame for actuator `id`.
    ///
    /// Layout without torque: `[position i16 0.2 mrad][velocity i16 2 mrad/s][kp u16 0.01 N·m/rad][kd u16 0.001 N·m·s/rad]`.
    ///
    /// Layout with torque: `[position i16 0.2 mrad][velocity i14 8 mrad/s][kp 11][kd 11][torque 12]`, from the lowest bit of
    /// the first byte up. Gains and torque are short codes with steps of 1 mN·m/rad, 0.1 mN·m·s/rad and 1 mN·m.
    ///
    /// A wide frame has the layout with torque, but gains and torque in steps 16 times as large, and possibly a torque of 0. It
    /// is sent if kp, kd or torque are beyond the scale of the other frames.
    ///
    /// `None` if a value is NaN or beyond its scale, or if `id` is above [`MAX_ID`].
    pub fn encode(&self, id: u8) -> Option<Frame> {
        let position = i16_steps(self.position_rad, POSITION_STEPS)?;
        if short_torque(self.torque_nm, SHORT_TORQUE_STEPS) == Some(0)
            && let Some(kp) = u16_steps(self.kp_nm_rad, KP_STEPS)
            && let Some(kd) = u16_steps(self.kd_nm_s_rad, KD_STEPS)
        {
            let [p0, p1] = position.to_le_bytes();
            let [v0, v1] = i16_steps(self.velocity_rad_s, SPEED_STEPS)?.to_le_bytes();
            let ([kp0, kp1], [kd0, kd1]) = (kp.to_le_bytes(), kd.to_le_bytes());
            let id = address(JOINT_SETPOINT, id)?;
            return Some(Frame::known(id, [p0, p1, v0, v1, kp0, kp1, kd0, kd1]));
        }
        let velocity = steps(self.velocity_rad_s, COARSE_SPEED_STEPS, (1 << 13) - 1)?;
        let low = u64::from(position as u16) | u64::from(velocity as u32 & 0x3FFF) << 16;
        let kp = |wider| short(self.kp_nm_rad, SHORT_KP_STEPS / wider, NEAREST);
        torque_frame(id, JOINT_TORQUE_SETPOINTS, low, &kp, (self.kd_nm_s_rad, self.torque_nm))
    }

    /// Decodes address and set-point; `None` for any other frame.
    pub fn decode(frame: &Frame) -> Option<(u8, Self)> {
        if let Some((id, word, wider)) = torque_word(frame, JOINT_TORQUE_SETPOINTS, LEAST_WIDE_GAIN)
        {
            let [p0, p1, ..] = word.to_le_bytes();
            // The arithmetic shift extends the sign of the 14 bits.
            let velocity = ((word >> 14) as i16) >> 2;
            let setpoint = Self {
                position_rad: signed(p0, p1, POSITION_STEPS)?,
                velocity_rad_s: f32::from(velocity) / COARSE_SPEED_STEPS,
                kp_nm_rad: from_short(word >> 30, SHORT_KP_STEPS / wider),
                kd_nm_s_rad: from_short(word >> 41, SHORT_KD_STEPS / wider),
                torque_nm: signed_short(word >> 52, SHORT_TORQUE_STEPS / wider),
            };
            return (velocity != -1 << 13).then_some((id, setpoint));
        }
        let (id, [p0, p1, v0, v1, kp0, kp1, kd0, kd1]) = split(frame, JOINT_SETPOINT)?;
        let setpoint = Self {
            position_rad: signed(p0, p1, POSITION_STEPS)?,
            velocity_rad_s: signed(v0, v1, SPEED_STEPS)?,
            kp_nm_rad: unsigned(kp0, kp1, KP_STEPS),
            kd_nm_s_rad: unsigned(kd0, kd1, KD_STEPS),
            torque_nm: 0.0,
        };
        Some((id, setpoint))
    }
}

/// Set-point of a wheel's drive: torque = kd (ω* − ω) + τ, within ±`torque_limit_nm`.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct WheelSetpoint {
    /// ω*, rad/s.
    pub speed_rad_s: f32,
    /// kd, N·m·s/rad.
    pub kd_nm_s_rad: f32,
    /// Torque limit, N·m.
    pub torque_limit_nm: f32,
    /// τ, N·m.
    pub torque_nm: f32,
}

impl WheelSetpoint {
    /// Encodes the set-point in a frame for actuator `id`.
    ///
    /// Layout without torque: `[speed i32 0.1 mrad/s][kd u16 0.001 N·m·s/rad][torque limit u16 5 mN·m]`.
    ///
    /// Layout with torque: `[speed i30 0.1 mrad/s][torque limit 11][kd 11][torque 12]`, with short codes like those of a joint.
    /// The torque limit is rounded down. A wide frame differs from it in the same way as a joint's wide frame
    /// ([`JointSetpoint::encode`]).
    ///
    /// `None` if a value is NaN or beyond its scale, or if `id` is above [`MAX_ID`].
    pub fn encode(&self, id: u8) -> Option<Frame> {
        if short_torque(self.torque_nm, SHORT_TORQUE_STEPS) == Some(0)
            && let Some(kd) = u16_steps(self.kd_nm_s_rad, KD_STEPS)
            && let Some(limit) = u16_steps(self.torque_limit_nm, TORQUE_STEPS)
        {
            let [s0, s1, s2, s3] =
                steps(self.speed_rad_s, WHEEL_SPEED_STEPS, i32::MAX)?.to_le_bytes();
            let ([kd0, kd1], [t0, t1]) = (kd.to_le_bytes(), limit.to_le_bytes());
            let id = address(WHEEL_SETPOINT, id)?;
            return Some(Frame::known(id, [s0, s1, s2, s3, kd0, kd1, t0, t1]));
        }
        let speed = steps(self.speed_rad_s, WHEEL_SPEED_STEPS, (1 << 29) - 1)?;
        let low = u64::from(speed as u32 & 0x3FFF_FFFF);
        let limit = |wider| short(self.torque_limit_nm, SHORT_TORQUE_STEPS / wider, DOWN);
        torque_frame(id, WHEEL_TORQUE_SETPOINTS, low, &limit, (self.kd_nm_s_rad, self.torque_nm))
    }

    /// Decodes address and set-point; `None` for any other frame.
    pub fn decode(frame: &Frame) -> Option<(u8, Self)> {
        if let Some((id, word, wider)) =
            torque_word(frame, WHEEL_TORQUE_SETPOINTS, LEAST_WIDE_LIMIT)
        {
            let speed = (word as i32) << 2 >> 2;
            let setpoint = Self {
                speed_rad_s: speed as f32 / WHEEL_SPEED_STEPS,
                kd_nm_s_rad: from_short(word >> 41, SHORT_KD_STEPS / wider),
                torque_limit_nm: from_short(word >> 30, SHORT_TORQUE_STEPS / wider),
                torque_nm: signed_short(word >> 52, SHORT_TORQUE_STEPS / wider),
            };
            return (speed != -1 << 29).then_some((id, setpoint));
        }
        let (id, [s0, s1, s2, s3, kd0, kd1, t0, t1]) = split(frame, WHEEL_SETPOINT)?;
        let raw = i32::from_le_bytes([s0, s1, s2, s3]);
        if raw == i32::MIN {
            return None;
        }
        let setpoint = Self {
            speed_rad_s: raw as f32 / WHEEL_SPEED_STEPS,
            kd_nm_s_rad: unsigned(kd0, kd1, KD_STEPS),
            torque_limit_nm: unsigned(t0, t1, TORQUE_STEPS),
            torque_nm: 0.0,
        };
        Some((id, setpoint))
    }
}

/// Command that switches torque, or requests feedback.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Control {
    /// Switches torque off, the state after power-on. Answered with a [`Feedback`].
    Disable,
    /// Makes the actuator follow set-points. Earlier set-points are discarded: there is no torque until the first set-point after
    /// this command. Answered with a [`Feedback`].
    Enable,
    /// Requests a [`Feedback`] and changes nothing. The controller measures the pose with it before torque is on.
    Query,
}

impl Control {
    /// Encodes one byte: 0 disable, 1 enable, 2 query. `None` if `id` is above [`MAX_ID`].
    pub fn encode(self, id: u8) -> Option<Frame> {
        let byte = match self {
            Control::Disable => 0,
            Control::Enable => 1,
            Control::Query => 2,
        };
        Some(Frame::known(address(CONTROL, id)?, [byte]))
    }

    /// Decodes address and command; `None` for any other frame.
    pub fn decode(frame: &Frame) -> Option<(u8, Self)> {
        let (id, [byte]) = split(frame, CONTROL)?;
        let control = match byte {
            0 => Control::Disable,
            1 => Control::Enable,
            2 => Control::Query,
            _ => return None,
        };
        Some((id, control))
    }
}

/// State of an actuator, as bits of its feedback.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct ActuatorStatus(pub u8);

impl ActuatorStatus {
    /// Torque is on.
    pub const ENABLED: u8 = 1 << 0;
    /// The torque is at its limit.
    pub const TORQUE_LIMITED: u8 = 1 << 1;
    /// The actuator is at its own position limit.
    pub const POSITION_LIMITED: u8 = 1 << 2;
    /// Set-point timeout: torque is off until the actuator is disabled and enabled again.
    pub const TIMED_OUT: u8 = 1 << 3;
    /// Too hot: torque is off.
    pub const OVERHEATED: u8 = 1 << 4;
    /// Supply voltage out of range: torque is off.
    pub const BAD_VOLTAGE: u8 = 1 << 5;
    /// Position sensor or other hardware failed: torque is off.
    pub const HARDWARE: u8 = 1 << 6;
    /// The feedback is too old to arm the robot, or a serial servo left a query unanswered since the previous telemetry. Set in
    /// telemetry only.
    pub const UNANSWERED: u8 = 1 << 7;
    /// Mask of the states in which the actuator cannot follow commands.
    pub const FAULTS: u8 = Self::TIMED_OUT | Self::OVERHEATED | Self::BAD_VOLTAGE | Self::HARDWARE;

    /// True if torque is on.
    pub fn enabled(self) -> bool {
        self.0 & Self::ENABLED != 0
    }

    /// True if the actuator left a query unanswered.
    pub fn is_unanswered(self) -> bool {
        self.0 & Self::UNANSWERED != 0
    }

    /// True if the actuator cannot follow commands.
    pub fn faulty(self) -> bool {
        self.0 & Self::FAULTS != 0
    }
}

/// Measurements of an actuator, sent in answer to every set-point and every [`Control`].
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Feedback {
    /// Angle, rad; −π to π for a wheel.
    pub position_rad: f32,
    /// Speed, rad/s.
    pub velocity_rad_s: f32,
    /// Torque, N·m.
    pub torque_nm: f32,
    /// State of the actuator.
    pub status: ActuatorStatus,
    /// Frame counter, which wraps. A repeated value marks a repeated frame.
    pub counter: u8,
}

impl Feedback {
    /// Encodes `[position i16 0.2 mrad][velocity i16 2 mrad/s][torque i16 5 mN·m][status u8][counter u8]`, or in a wide frame
    /// `[position i16][velocity i20 2 mrad/s][torque 12][status u8][counter u8]`, whose torque is a short code with a sign and
    /// steps of 16 mN·m. The frame is wide if speed or torque are beyond the narrow scale. Measurements beyond the wide scale
    /// saturate. `None` if `id` is above [`MAX_ID`].
    pub fn encode(&self, id: u8) -> Option<Frame> {
        let [p0, p1] = measured(self.position_rad, POSITION_STEPS).to_le_bytes();
        let (base, [v0, v1, t0, t1]) = measurement(self.velocity_rad_s, self.torque_nm)
            .map_or_else(|wide| (WIDE_FEEDBACK, wide), |narrow| (FEEDBACK, narrow));
        let data = [p0, p1, v0, v1, t0, t1, self.status.0, self.counter];
        Some(Frame::known(address(base, id)?, data))
    }

    /// Decodes address and feedback; `None` for any other frame.
    pub fn decode(frame: &Frame) -> Option<(u8, Self)> {
        let (is_wide, (id, [p0, p1, v0, v1, t0, t1, status, counter])) =
            match split(frame, FEEDBACK) {
                Some(narrow) => (false, narrow),
                None => (true, split(frame, WIDE_FEEDBACK)?),
            };
        let (velocity_rad_s, torque_nm) = from_measurement([v0, v1, t0, t1], is_wide)?;
        let feedback = Self {
            position_rad: signed(p0, p1, POSITION_STEPS)?,
            velocity_rad_s,
            torque_nm,
            status: ActuatorStatus(status),
            counter,
        };
        Some((id, feedback))
    }
}
