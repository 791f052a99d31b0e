//! Conversion of angles and speeds to 16-bit integers and back.
//!
//! A quantum is a power of two. Hence `value = quanta · 2^exponent` is exact in `f32` on every machine, and limits can be
//! compared without tolerance.

use super::RATE_HZ;
use super::records::ChannelRecord;
use crate::config::{Channel, ChannelKind};

/// Exponent of the quantum of joint angles, and of the finest quantum of a wheel. The quantum is 2⁻¹⁰ rad = 0.977 mrad, which
/// rounds by at most 0.49 mrad.
pub(crate) const FINEST_EXPONENT: i8 = -10;
/// Exponent of the coarsest quantum of a record: 2⁶ rad/s.
const COARSEST_EXPONENT: i8 = 6;
/// Exponent of the finest quantum of a torque: 0.06 µN·m.
const FINEST_TORQUE_EXPONENT: i8 = -24;
/// Largest magnitude of a value in quanta. Below 2¹⁵ to leave headroom for calculations.
const MAX_QUANTA: f32 = 32000.0;

/// Quantum 2^`exponent`.
pub(crate) fn lsb(exponent: i8) -> f32 {
    let biased = 127 + i32::from(exponent.clamp(FINEST_TORQUE_EXPONENT, COARSEST_EXPONENT));
    f32::from_bits((biased as u32) << 23)
}

/// Largest integer that is not above `x`, saturating.
fn floor(x: f32) -> i32 {
    let t = x as i32;
    if (t as f32) > x { t.saturating_sub(1) } else { t }
}

fn ceil(x: f32) -> i32 {
    floor(-x).saturating_neg()
}

/// Quantum and limits of a channel. They depend only on the configuration, so that a library can be checked against it. `None`
/// if the limits do not fit in 16 bits.
pub(crate) fn channel_record(channel: &Channel) -> Option<ChannelRecord> {
    let reach = channel.min.abs().max(channel.max.abs());
    let mut exponent = FINEST_EXPONENT;
    if channel.kind == ChannelKind::WheelSpeed {
        while exponent < COARSEST_EXPONENT && reach > MAX_QUANTA * lsb(exponent) {
            exponent += 1;
        }
    }
    let lsb = lsb(exponent);
    // A NaN fails this comparison, as intended.
    let fits = reach <= MAX_QUANTA * lsb && channel.max_rate > 0.0;
    let min = i16::try_from(ceil(channel.min / lsb)).ok()?;
    let max = i16::try_from(floor(channel.max / lsb)).ok()?;
    // Rounding moves each frame of a step by at most half a quantum, together one quantum.
    let step = floor(channel.max_rate / (lsb * f32::from(RATE_HZ))).saturating_add(1);
    let max_step = step.clamp(1, i32::from(i16::MAX)) as u16;
    (fits && min <= max).then_some(ChannelRecord {
        kind: match channel.kind {
            ChannelKind::JointPosition => 0,
            ChannelKind::WheelSpeed => 1,
        },
        lsb_exponent: exponent,
        min,
        max,
        max_step,
    })
}

/// Value of `quanta`, rad or rad/s.
pub(crate) fn value(quanta: i32, exponent: i8) -> f32 {
    quanta as f32 * lsb(exponent)
}

/// Exponent of the quantum of a channel's torques, N·m, and torque limit in quanta.
///
/// The limit is 1024 to 2047 quanta, so rounding moves a torque by at most 1/2048 of the limit. Limits below 60 µN·m have fewer
/// quanta.
pub(crate) fn torque_record(channel: &Channel) -> (i8, i16) {
    // Exponent of the limit, which is positive and at most 20,000 N·m.
    let exponent = ((channel.max_torque_nm.to_bits() >> 23) & 0xFF) as i32 - 127;
    let exponent = (exponent - 10).max(i32::from(FINEST_TORQUE_EXPONENT)) as i8;
    (exponent, (channel.max_torque_nm / lsb(exponent)) as i16)
}

/// Nearest quanta of a torque within the limit. `None` if `torque_nm` is NaN, or beyond the limit by more than half a quantum.
pub(crate) fn quantise_torque(torque_nm: f32, channel: &Channel) -> Option<i16> {
    let (exponent, limit) = torque_record(channel);
    let in_reach = torque_nm.abs() <= channel.max_torque_nm + 0.5 * lsb(exponent);
    let exact = f64::from(torque_nm) / f64::from(lsb(exponent));
    let nearest = if exact < 0.0 { exact - 0.5 } else { exact + 0.5 } as i16;
    in_reach.then_some(nearest.min(limit).max(-limit))
}

/// Nearest quanta within the limits. `None` if `value` is NaN, or beyond a limit by more than half a quantum. The half quantum
/// allows for rounding of values that an optimiser left on the limit.
pub(crate) fn quantise(value: f32, channel: &Channel, record: &ChannelRecord) -> Option<i16> {
    let lsb = lsb(record.lsb_exponent);
    let in_reach = value >= channel.min - 0.5 * lsb && value <= channel.max + 0.5 * lsb;
    // In f64, because adding 0.5 to an f32 could round a second time.
    let exact = f64::from(value) / f64::from(lsb);
    let nearest = if exact < 0.0 { exact - 0.5 } else { exact + 0.5 } as i32;
    let inside = nearest.min(i32::from(record.max)).max(i32::from(record.min));
    in_reach.then_some(inside as i16)
}
