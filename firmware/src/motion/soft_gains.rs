//! Fractions of the gains in force: a host that tracks a robot softens joints, and the gains later rise without a pull.

use rollwalk_protocol::config::MAX_CHANNELS;

/// Fastest rise of the gain fraction of a channel, 1/s: eightfold in 0.1 s at 120 Hz.
const GAIN_RISE_1_S: f32 = 23.0;
/// Fraction of the full gain from which a gain rises if it was 0.
const LEAST_PART: f32 = 0.02;

/// Gain fractions of all channels.
pub(super) struct SoftGains {
    /// Fractions of kp and kd of each channel in force.
    parts: [[f32; 2]; MAX_CHANNELS],
    /// True if any fraction is below 1.
    is_soft: bool,
    /// Torque of a joint's position error when its gains began to rise, divided by the full kp, rad. The value stays constant
    /// while the gains rise.
    leans_rad: [f32; MAX_CHANNELS],
}

impl SoftGains {
    pub fn new() -> Self {
        Self { parts: [[1.0; 2]; MAX_CHANNELS], is_soft: false, leans_rad: [0.0; MAX_CHANNELS] }
    }

    /// Sets all gain fractions to 1 at once.
    pub fn reset(&mut self) {
        self.parts = [[1.0; 2]; MAX_CHANNELS];
        self.is_soft = false;
    }

    /// Drops the torques that are held constant while gains rise.
    pub fn drop_leans(&mut self) {
        self.leans_rad = [0.0; MAX_CHANNELS];
    }

    /// Returns true if any fraction was below 1, and clears the flag, which [`Self::advance`] sets again.
    pub fn take_soft(&mut self) -> bool {
        core::mem::take(&mut self.is_soft)
    }

    /// Returns the set-point at which the full gains produce the torque that the current gain fractions produce at `meant`, the
    /// latest set-point. Later rises of the gains keep this torque.
    ///
    /// Returns `meant` for a channel without a measured angle.
    pub fn rest(&mut self, channel: usize, meant: f32, measured_rad: Option<f32>) -> Option<f32> {
        let [kp, _] = *self.parts.get(channel)?;
        let lean_rad = self.leans_rad.get_mut(channel)?;
        let measured = measured_rad.filter(|_| kp < 1.0).unwrap_or(meant);
        *lean_rad = kp * (meant - measured);
        Some(measured + *lean_rad)
    }

    /// Advances the gain fractions of a channel towards `wanted`. Returns them with the required distance of a joint's
    /// set-point from its target, rad.
    ///
    /// Fractions fall at once and rise by [`GAIN_RISE_1_S`]. While they rise, the distance of the set-point from the measured
    /// angle shrinks in proportion. A joint away from its set-point is then not pulled there. The rise is also limited so that
    /// the set-point moves by at most `most_rad` in a period.
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
