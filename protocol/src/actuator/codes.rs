//! Codes of quantities in frames: fixed-point numbers of 16 to 32 bits, and short floating-point numbers.

// Steps of a unit. Whole numbers, so that `steps / STEPS` is the nearest f32 to the decimal value.
pub const POSITION_STEPS: f32 = 5000.0;
pub const SPEED_STEPS: f32 = 500.0;
pub const WHEEL_SPEED_STEPS: f32 = 10_000.0;
pub const TORQUE_STEPS: f32 = 200.0;
pub const KP_STEPS: f32 = 100.0;
pub const KD_STEPS: f32 = 1000.0;

/// Nearest number of steps; `None` if `value` is NaN, or beyond ±`most` steps.
pub fn steps(value: f32, per_unit: f32, most: i32) -> Option<i32> {
    let exact = value * per_unit;
    // Saturating casts. A NaN becomes 0 and fails the comparison.
    let nearest = if exact < 0.0 { exact - 0.5 } else { exact + 0.5 } as i32;
    (exact.abs() < most as f32 + 0.5 && nearest >= -most && nearest <= most).then_some(nearest)
}

pub fn i16_steps(value: f32, per_unit: f32) -> Option<i16> {
    steps(value, per_unit, i32::from(i16::MAX)).map(|s| s as i16)
}

/// Nearest number of steps. Values up to one step above the scale saturate; the wide codes begin above.
pub fn u16_steps(value: f32, per_unit: f32) -> Option<u16> {
    const BEYOND: i32 = 1 << 16;
    let nearest = steps(value, per_unit, BEYOND).filter(|_| value * per_unit < BEYOND as f32)?;
    u16::try_from(nearest.min(BEYOND - 1)).ok()
}

/// Nearest number of steps. Values beyond ±`most` saturate; NaN becomes 0.
// One copy in the image instead of one at each call; likewise below.
#[inline(never)]
pub fn saturated(value: f32, per_unit: f32, most: i32) -> i32 {
    let exact = value * per_unit;
    let nearest = if exact < 0.0 { exact - 0.5 } else { exact + 0.5 } as i32;
    nearest.clamp(most.saturating_neg(), most)
}

/// Encodes a measurement. Values beyond the scale saturate, since a measurement is always reported. NaN becomes 0.
pub fn measured(value: f32, per_unit: f32) -> i16 {
    saturated(value, per_unit, i16::MAX.into()) as i16
}

/// Largest velocity in 20-bit codes, steps.
const MAX_WIDE_SPEED: i32 = (1 << 19) - 1;
/// Short code of 163.84 N·m in wide steps, the smallest torque that does not fit a 16-bit code: (128 + 32) · 2⁶ steps.
const LEAST_WIDE_TORQUE: u32 = 7 << 7 | 32;

/// Encodes speed and torque of a measurement in 32 bits. `Ok` contains two 16-bit codes. If one of them would saturate, `Err`
/// contains the wide code. It has the velocity in 20 bits in steps of 2 mrad/s, then the torque as a short code of 12 bits in
/// steps of 16 mN·m. Values beyond its scale saturate; NaN becomes 0.
pub fn measurement(velocity_rad_s: f32, torque_nm: f32) -> Result<[u8; 4], [u8; 4]> {
    let velocity = saturated(velocity_rad_s, SPEED_STEPS, MAX_WIDE_SPEED);
    let torque = saturated(torque_nm, TORQUE_STEPS, i32::MAX);
    if let (Ok(velocity), Ok(torque)) = (i16::try_from(velocity), i16::try_from(torque))
        && velocity != i16::MIN
        && torque != i16::MIN
    {
        let ([v0, v1], [t0, t1]) = (velocity.to_le_bytes(), torque.to_le_bytes());
        return Ok([v0, v1, t0, t1]);
    }
    let most_nm = from_short(SHORT_MOST.into(), WIDE_TORQUE_STEPS);
    let torque = short_torque(torque_nm.clamp(-most_nm, most_nm), WIDE_TORQUE_STEPS).unwrap_or(0);
    Err((velocity as u32 & 0xF_FFFF | (torque as u32) << 20).to_le_bytes())
}

/// Decodes speed and torque of a measurement; `None` for the invalid lowest codes, and for a wide code that no value has.
pub fn from_measurement(bytes: [u8; 4], is_wide: bool) -> Option<(f32, f32)> {
    if !is_wide {
        let [v0, v1, t0, t1] = bytes;
        return Some((signed(v0, v1, SPEED_STEPS)?, signed(t0, t1, TORQUE_STEPS)?));
    }
    let word = u32::from_le_bytes(bytes);
    // Extends the sign of the 20 bits.
    let velocity = (word as i32) << 12 >> 12;
    let torque = word >> 20;
    let magnitude = torque & SHORT_MOST;
    let is_sent = velocity.unsigned_abs() > 0x7FFF || magnitude >= LEAST_WIDE_TORQUE;
    let is_zero = magnitude == 0 && torque != 0;
    (velocity >= -MAX_WIDE_SPEED && is_sent && !is_zero)
        .then_some((velocity as f32 / SPEED_STEPS, signed_short(torque.into(), WIDE_TORQUE_STEPS)))
}

/// Decodes a signed value; `None` for the invalid code −32768.
pub fn signed(low: u8, high: u8, per_unit: f32) -> Option<f32> {
    let raw = i16::from_le_bytes([low, high]);
    (raw != i16::MIN).then(|| f32::from(raw) / per_unit)
}

pub fn unsigned(low: u8, high: u8, per_unit: f32) -> f32 {
    f32::from(u16::from_le_bytes([low, high])) / per_unit
}

// Steps of a unit in setpoints with torque.
pub const COARSE_SPEED_STEPS: f32 = 125.0;
pub const SHORT_KP_STEPS: f32 = 1000.0;
pub const SHORT_KD_STEPS: f32 = 10_000.0;
pub const SHORT_TORQUE_STEPS: f32 = 1000.0;
/// Ratio of the steps of gains and torques in wide frames to those in frames with torque.
pub const WIDER: f32 = 16.0;
pub const WIDE_TORQUE_STEPS: f32 = SHORT_TORQUE_STEPS / WIDER;
/// Offset between the upper 16 bits of an `f32` and a short code. The upper bits of 128.0 map to the code 128, whose exponent
/// is 1.
pub const SHORT_BIAS: u32 = (134 << 7) - 128;
pub const SHORT_MOST: u32 = (1 << 11) - 1;

/// Encodes a non-negative value in an 11-bit short code: exponent e in the upper 4 bits, mantissa m in the lower 7. The code
/// stands for m steps if e = 0, otherwise for `(128 + m) · 2^(e−1)` steps. The rounding error is at most half a step below 128
/// steps, and 1/256 of the value above.
// One copy in the image instead of one at each call; likewise below.
#[inline(never)]
pub fn short(value: f32, per_unit: f32, rounding: u32) -> Option<u64> {
    let steps = value * per_unit;
    let code = if steps < 128.0 {
        // A negative number becomes 0, and is refused below.
        (steps + rounding as f32 / 65536.0) as u32
    } else {
        (steps.to_bits().saturating_add(rounding) >> 16).saturating_sub(SHORT_BIAS)
    };
    (value >= 0.0 && code <= SHORT_MOST).then_some(u64::from(code))
}

pub const NEAREST: u32 = 1 << 15;
/// Rounding term that rounds a limit down, except for the rounding error of the product.
pub const DOWN: u32 = 1 << 6;

pub fn from_short(code: u64, per_unit: f32) -> f32 {
    let code = code as u32 & SHORT_MOST;
    let steps = if code < 128 { code as f32 } else { f32::from_bits((code + SHORT_BIAS) << 16) };
    steps / per_unit
}

/// Encodes a torque in 12 bits: the sign in the highest bit, a short code in the others. `Some(0)` if the torque rounds to 0.
pub fn short_torque(torque_nm: f32, per_unit: f32) -> Option<u64> {
    let code = short(torque_nm.abs(), per_unit, NEAREST)?;
    Some(if torque_nm < 0.0 && code > 0 { 1 << 11 | code } else { code })
}

/// Decodes a torque of 12 bits.
pub fn signed_short(code: u64, per_unit: f32) -> f32 {
    let magnitude = from_short(code, per_unit);
    if code >> 11 & 1 != 0 && magnitude != 0.0 { -magnitude } else { magnitude }
}
