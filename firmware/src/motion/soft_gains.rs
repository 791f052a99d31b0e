//! Parts of the gains that act: a host that tracks softens joints, and their gains rise again without a pull.

use rollwalk_protocol::config::MAX_CHANNELS;

/// Fastest rise of the part of a channel's gains that acts, 1/s: eightfold in 0.1 s at 120 Hz.
const GAIN_RISE_1_S: f32 = 23.0;
/// Part from which gains rise that were 0.
const LEAST_PART: f32 = 0.02;

/// Parts of the gains of all channels.
pub(super) struct SoftGains {
    /// Parts of the gains that act, of each channel: kp, kd.
    parts: [[f32; 2]; MAX_CHANNELS],
    /// True if any part is below 1.
    is_soft: bool,
    /// Torque of a joint's angle when its gains began to rise, divided by the full kp, rad: it stays while they rise.
    leans_rad: [f32; MAX_CHANNELS],
}

impl SoftGains {
    pub fn new() -> Self {
        Self { parts: [[1.0; 2]; MAX_CHANNELS], is_soft: false, leans_rad: [0.0; MAX_CHANNELS] }
    }

    /// Has all gains act at once.
    pub fn reset(&mut self) {
        self.parts = [[1.0; 2]; MAX_CHANNELS];
        self.is_soft = false;
    }

    /// Drops the torques that stay while gains rise.
    pub fn drop_leans(&mut self) {
        self.leans_rad = [0.0; MAX_CHANNELS];
    }

    /// Returns true if any part was below 1, and resets the flag, which [`Self::advance`] sets again.
    pub fn take_soft(&mut self) -> bool {
        core::mem::take(&mut self.is_soft)
    }

    /// The value of a channel around which all of its gains make the torque that the present parts of them make around
    /// `meant`, its last setpoint; of a channel without a measured angle that setpoint.
    pub fn rest(&mut self, channel: usize, meant: f32, measured_rad: Option<f32>) -> Option<f32> {
        let [kp, _] = *self.parts.get(channel)?;
        let lean_rad = self.leans_rad.get_mut(channel)?;
        let measured = measured_rad.filter(|_| kp < 1.0).unwrap_or(meant);
        *lean_rad = kp * (meant - measured);
        Some(measured + *lean_rad)
    }

    /// The parts of a channel's gains that act now, of those that are wanted, and how far the angle of a joint is to be
    /// from its target, rad.
    ///
    /// They fall at once and rise by [`GAIN_RISE_1_S`], while the angle comes as near as they rise: a joint that is away
    /// from its setpoint is not pulled there. They rise no faster than the setpoint may move, `most_rad` in a period.
    pub fn advance(
        &mut self,
        period_s: f32,
        most_rad: f32,
        channel: usize,
        wanted: [f32; 2],
    ) -> ([f32; 2], f32) {
        let acting = self.parts(period_s, most_rad, channel, wanted);
        self.is_soft |= acting.0 != [1.0; 2];
        acting
    }

    fn parts(
        &mut self,
        period_s: f32,
        most_rad: f32,
        channel: usize,
        wanted: [f32; 2],
    ) -> ([f32; 2], f32) {
        let rise = 1.0 + GAIN_RISE_1_S * period_s;
        let (Some(parts), Some(lean_rad)) =
            (self.parts.get_mut(channel), self.leans_rad.get_mut(channel))
        else {
            return (wanted, 0.0);
        };
        let [before, _] = *parts;
        for (part, wanted) in parts.iter_mut().zip(wanted) {
            *part = wanted.min(part.max(LEAST_PART) * rise);
        }
        let [kp, _] = parts;
        if *lean_rad != 0.0 {
            let nearest = 1.0 / before - most_rad / lean_rad.abs();
            *kp = if *kp * nearest > 1.0 { 1.0 / nearest } else { *kp };
        }
        if *kp >= 1.0 {
            *lean_rad = 0.0;
        }
        let off_rad = if *lean_rad == 0.0 { 0.0 } else { *lean_rad * (1.0 / *kp - 1.0) };
        (*parts, off_rad)
    }
}
