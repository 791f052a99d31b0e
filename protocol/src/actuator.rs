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
//!
//! `n` is 0 to 127. [`Control`] frames have priority over set-points on a busy bus. Integers are little-endian and two's
//! complement. Values are rounded to the nearest step, and 0 is encoded exactly. The code −32768 is never sent, and is refused
//! on receipt.
//!
//! A value beyond its scale is not sent: `encode` returns `None`. This cannot happen within the limits of a configuration that
//! passed [`crate::config::RobotConfig::check`].
//!
//! A set-point whose torque rounds to 0 is sent in the frame without torque. Drives that do not support torque follow it, too.

use crate::can::Frame;

/// Largest address of an actuator.
pub const MAX_ID: u8 = 0x7F;
/// Position step in rad: 0.2 mrad. Codes span ±6.5534 rad, a little more than a turn.
pub const POSITION_STEP_RAD: f32 = 1.0 / POSITION_STEPS;
/// Largest position, rad.
pub const MAX_POSITION_RAD: f32 = 6.5;
/// Speed step of 16-bit codes in rad/s: 2 mrad/s. Codes span ±65.534 rad/s.
pub const SPEED_STEP_RAD_S: f32 = 1.0 / SPEED_STEPS;
/// Largest speed, rad/s.
pub const MAX_SPEED_RAD_S: f32 = 65.0;
/// Speed step of wheel set-points in rad/s: 0.1 mrad/s, in 32-bit codes. Decoded values encode to the same bytes up to 2²²
/// steps, ±419 rad/s. Above that, an `f32` may be off by a step.
pub const WHEEL_SPEED_STEP_RAD_S: f32 = 1.0 / WHEEL_SPEED_STEPS;
/// Torque step in N·m: 5 mN·m. Codes span ±163.8 N·m, or 0 to 327 N·m for a limit.
pub const TORQUE_STEP_NM: f32 = 1.0 / TORQUE_STEPS;
/// Largest torque, N·m.
pub const MAX_TORQUE_NM: f32 = 160.0;
/// Step of the proportional gain, N·m/rad: 0.01.
pub const KP_STEP_NM_RAD: f32 = 1.0 / KP_STEPS;
/// Largest proportional gain, N·m/rad.
pub const MAX_KP_NM_RAD: f32 = 655.0;
/// Step of the damping gain, N·m·s/rad: 0.001.
pub const KD_STEP_NM_S_RAD: f32 = 1.0 / KD_STEPS;
/// Largest damping gain, N·m·s/rad.
pub const MAX_KD_NM_S_RAD: f32 = 65.0;

const CONTROL: u16 = 0x080;
const JOINT_SETPOINT: u16 = 0x100;
const FEEDBACK: u16 = 0x180;
const WHEEL_SETPOINT: u16 = 0x200;
const JOINT_TORQUE_SETPOINT: u16 = 0x280;
const WHEEL_TORQUE_SETPOINT: u16 = 0x300;

// Steps of a unit. Whole numbers, so that `steps / STEPS` is the nearest f32 to the decimal value.
pub(crate) const POSITION_STEPS: f32 = 5000.0;
pub(crate) const SPEED_STEPS: f32 = 500.0;
const WHEEL_SPEED_STEPS: f32 = 10_000.0;
pub(crate) const TORQUE_STEPS: f32 = 200.0;
const KP_STEPS: f32 = 100.0;
const KD_STEPS: f32 = 1000.0;

/// Nearest number of steps; `None` if `value` is NaN, or beyond ±`most` steps.
fn steps(value: f32, per_unit: f32, most: i32) -> Option<i32> {
    let exact = value * per_unit;
    // Saturating casts. A NaN becomes 0 and fails the comparison.
    let nearest = if exact < 0.0 { exact - 0.5 } else { exact + 0.5 } as i32;
    (exact.abs() < most as f32 + 0.5 && nearest >= -most && nearest <= most).then_some(nearest)
}

fn i16_steps(value: f32, per_unit: f32) -> Option<i16> {
    steps(value, per_unit, i32::from(i16::MAX)).map(|s| s as i16)
}

fn u16_steps(value: f32, per_unit: f32) -> Option<u16> {
    steps(value, per_unit, i32::from(u16::MAX)).and_then(|s| u16::try_from(s).ok())
}

/// Encodes a measurement. Values beyond the scale saturate, since a measurement is always reported. NaN becomes 0.
pub(crate) fn measured(value: f32, per_unit: f32) -> i16 {
    let most = f32::from(i16::MAX);
    let exact = (value * per_unit).clamp(-most, most);
    if exact < 0.0 { (exact - 0.5) as i16 } else { (exact + 0.5) as i16 }.max(-i16::MAX)
}

/// Decodes a signed value; `None` for the invalid code −32768.
pub(crate) fn signed(low: u8, high: u8, per_unit: f32) -> Option<f32> {
    let raw = i16::from_le_bytes([low, high]);
    (raw != i16::MIN).then(|| f32::from(raw) / per_unit)
}

fn unsigned(low: u8, high: u8, per_unit: f32) -> f32 {
    f32::from(u16::from_le_bytes([low, high])) / per_unit
}

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

// Steps of a unit in setpoints with torque.
const COARSE_SPEED_STEPS: f32 = 125.0;
const SHORT_KP_STEPS: f32 = 1000.0;
const SHORT_KD_STEPS: f32 = 10_000.0;
const SHORT_TORQUE_STEPS: f32 = 1000.0;
/// Offset between the upper 16 bits of an `f32` and a short code. The upper bits of 128.0 map to the code 128, whose exponent
/// is 1.
const SHORT_BIAS: u32 = (134 << 7) - 128;
const SHORT_MOST: u32 = (1 << 11) - 1;

/// Encodes a non-negative value in an 11-bit short code: exponent e in the upper 4 bits, mantissa m in the lower 7. The code
/// stands for m steps if e = 0, otherwise for `(128 + m) · 2^(e−1)` steps. The rounding error is at most half a step below 128
/// steps, and 1/256 of the value above.
// One copy in the image instead of one at each call; likewise below.
#[inline(never)]
fn short(value: f32, per_unit: f32, rounding: u32) -> Option<u64> {
    let steps = value * per_unit;
    let code = if steps < 128.0 {
        // A negative number and a NaN become 0, and are refused below.
        (steps + rounding as f32 / 65536.0) as u32
    } else {
        (steps.to_bits().saturating_add(rounding) >> 16).saturating_sub(SHORT_BIAS)
    };
    (value >= 0.0 && code <= SHORT_MOST).then_some(u64::from(code))
}

const NEAREST: u32 = 1 << 15;
/// Rounding term that rounds a limit down, except for the rounding error of the product.
const DOWN: u32 = 1 << 6;

fn from_short(code: u64, per_unit: f32) -> f32 {
    let code = code as u32 & SHORT_MOST;
    let steps = if code < 128 { code as f32 } else { f32::from_bits((code + SHORT_BIAS) << 16) };
    steps / per_unit
}

/// Encodes a torque in 12 bits: the sign in the highest bit, a short code in the others. `Some(0)` if the torque rounds to 0.
fn short_torque(torque_nm: f32) -> Option<u64> {
    let code = short(torque_nm.abs(), SHORT_TORQUE_STEPS, NEAREST)?;
    Some(if torque_nm < 0.0 && code > 0 { 1 << 11 | code } else { code })
}

/// Decodes the last 34 bits of a set-point with torque. Returns the short code of kp or of the torque limit, the short code of
/// kd, and the torque in N·m. `None` if the torque is 0, which such a frame never contains.
fn torque_setpoint(word: u64) -> Option<(u64, u64, f32)> {
    let (first, kd, torque) = (word >> 30, word >> 41, word >> 52);
    let torque_nm = from_short(torque, SHORT_TORQUE_STEPS);
    (torque_nm != 0.0).then_some((
        first,
        kd,
        if torque >> 11 != 0 { -torque_nm } else { torque_nm },
    ))
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
    /// `None` if a value is NaN or beyond its scale, or if `id` is above [`MAX_ID`].
    pub fn encode(&self, id: u8) -> Option<Frame> {
        let position = i16_steps(self.position_rad, POSITION_STEPS)?;
        let torque = short_torque(self.torque_nm)?;
        if torque != 0 {
            let velocity = steps(self.velocity_rad_s, COARSE_SPEED_STEPS, (1 << 13) - 1)?;
            let word = u64::from(position as u16)
                | u64::from(velocity as u32 & 0x3FFF) << 16
                | short(self.kp_nm_rad, SHORT_KP_STEPS, NEAREST)? << 30
                | short(self.kd_nm_s_rad, SHORT_KD_STEPS, NEAREST)? << 41
                | torque << 52;
            return Some(Frame::known(address(JOINT_TORQUE_SETPOINT, id)?, word.to_le_bytes()));
        }
        let [p0, p1] = position.to_le_bytes();
        let [v0, v1] = i16_steps(self.velocity_rad_s, SPEED_STEPS)?.to_le_bytes();
        let [kp0, kp1] = u16_steps(self.kp_nm_rad, KP_STEPS)?.to_le_bytes();
        let [kd0, kd1] = u16_steps(self.kd_nm_s_rad, KD_STEPS)?.to_le_bytes();
        let id = address(JOINT_SETPOINT, id)?;
        Some(Frame::known(id, [p0, p1, v0, v1, kp0, kp1, kd0, kd1]))
    }

    /// Decodes address and set-point; `None` for any other frame.
    pub fn decode(frame: &Frame) -> Option<(u8, Self)> {
        if let Some((id, [p0, p1, rest @ ..])) = split::<8>(frame, JOINT_TORQUE_SETPOINT) {
            let [r0, r1, r2, r3, r4, r5] = rest;
            let word = u64::from_le_bytes([p0, p1, r0, r1, r2, r3, r4, r5]);
            // The two highest bits of 16 are the sign's.
            let velocity = ((word >> 14) as i16) >> 2;
            let (kp, kd, torque_nm) = torque_setpoint(word)?;
            let setpoint = Self {
                position_rad: signed(p0, p1, POSITION_STEPS)?,
                velocity_rad_s: f32::from(velocity) / COARSE_SPEED_STEPS,
                kp_nm_rad: from_short(kp, SHORT_KP_STEPS),
                kd_nm_s_rad: from_short(kd, SHORT_KD_STEPS),
                torque_nm,
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
    /// The torque limit is rounded down.
    ///
    /// `None` if a value is NaN or beyond its scale, or if `id` is above [`MAX_ID`].
    pub fn encode(&self, id: u8) -> Option<Frame> {
        let torque = short_torque(self.torque_nm)?;
        if torque != 0 {
            let speed = steps(self.speed_rad_s, WHEEL_SPEED_STEPS, (1 << 29) - 1)?;
            let word = u64::from(speed as u32 & 0x3FFF_FFFF)
                | short(self.torque_limit_nm, SHORT_TORQUE_STEPS, DOWN)? << 30
                | short(self.kd_nm_s_rad, SHORT_KD_STEPS, NEAREST)? << 41
                | torque << 52;
            return Some(Frame::known(address(WHEEL_TORQUE_SETPOINT, id)?, word.to_le_bytes()));
        }
        let [s0, s1, s2, s3] = steps(self.speed_rad_s, WHEEL_SPEED_STEPS, i32::MAX)?.to_le_bytes();
        let [kd0, kd1] = u16_steps(self.kd_nm_s_rad, KD_STEPS)?.to_le_bytes();
        let [t0, t1] = u16_steps(self.torque_limit_nm, TORQUE_STEPS)?.to_le_bytes();
        let id = address(WHEEL_SETPOINT, id)?;
        Some(Frame::known(id, [s0, s1, s2, s3, kd0, kd1, t0, t1]))
    }

    /// Decodes address and set-point; `None` for any other frame.
    pub fn decode(frame: &Frame) -> Option<(u8, Self)> {
        if let Some((id, bytes)) = split(frame, WHEEL_TORQUE_SETPOINT) {
            let word = u64::from_le_bytes(bytes);
            let speed = (word as i32) << 2 >> 2;
            let (limit, kd, torque_nm) = torque_setpoint(word)?;
            let setpoint = Self {
                speed_rad_s: speed as f32 / WHEEL_SPEED_STEPS,
                kd_nm_s_rad: from_short(kd, SHORT_KD_STEPS),
                torque_limit_nm: from_short(limit, SHORT_TORQUE_STEPS),
                torque_nm,
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
    /// Makes the actuator follow set-points. Earlier set-points are discarded: there is no torque until the first one after
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
    /// The actuator reached a position limit of its own.
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
    /// Encodes `[position i16 0.2 mrad][velocity i16 2 mrad/s][torque i16 5 mN·m][status u8][counter u8]`. Measurements beyond
    /// their scale saturate. `None` if `id` is above [`MAX_ID`].
    pub fn encode(&self, id: u8) -> Option<Frame> {
        let [p0, p1] = measured(self.position_rad, POSITION_STEPS).to_le_bytes();
        let [v0, v1] = measured(self.velocity_rad_s, SPEED_STEPS).to_le_bytes();
        let [t0, t1] = measured(self.torque_nm, TORQUE_STEPS).to_le_bytes();
        let data = [p0, p1, v0, v1, t0, t1, self.status.0, self.counter];
        Some(Frame::known(address(FEEDBACK, id)?, data))
    }

    /// Decodes address and feedback; `None` for any other frame.
    pub fn decode(frame: &Frame) -> Option<(u8, Self)> {
        let (id, [p0, p1, v0, v1, t0, t1, status, counter]) = split(frame, FEEDBACK)?;
        let feedback = Self {
            position_rad: signed(p0, p1, POSITION_STEPS)?,
            velocity_rad_s: signed(v0, v1, SPEED_STEPS)?,
            torque_nm: signed(t0, t1, TORQUE_STEPS)?,
            status: ActuatorStatus(status),
            counter,
        };
        Some((id, feedback))
    }
}
