//! Times of a choreography on the sample grid.

use super::{Ends, HeightLimit, Motion};

/// Time on the sample grid: a sample, and the distance from it in intervals.
///
/// A motion that is not periodic has no samples beyond its ends. Times in its first half interval refer to the second sample,
/// those in its last half interval to the last sample but one. Fractions are then up to ±1.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Moment {
    /// Index of the middle sample.
    pub sample: usize,
    /// Distance from the middle sample in intervals.
    pub fraction: f64,
}

impl Moment {
    /// Locates a time of a motion on the grid.
    pub fn of(motion: &Motion, at_s: f64) -> Self {
        let samples = motion.stance.len();
        let (first, last) = match motion.ends {
            Ends::Periodic => (0, samples - 1),
            Ends::AtRest | Ends::Prescribed => (1, samples - 2),
        };
        let position = at_s / motion.interval_s();
        let sample = (position.round().max(0.0) as usize).clamp(first, last);
        let fraction = position - sample as f64;
        // Motion files round times to a few digits: a rounded time counts as that of its sample.
        let nearest = fraction.round();
        let on_sample = (fraction - nearest).abs() < 1e-6;
        Self { sample, fraction: if on_sample { nearest } else { fraction } }
    }

    /// Index of the nearest sample; the end of a period counts as sample 0.
    pub fn nearest(self, motion: &Motion) -> usize {
        let nearest = (self.sample as f64 + self.fraction).round() as usize;
        if motion.ends == Ends::Periodic { nearest % motion.stance.len() } else { nearest }
    }

    /// Weights of the samples before, in the middle and after, for positions.
    pub fn position_weights(self) -> [f64; 3] {
        let u = self.fraction;
        [0.5 * u * (u - 1.0), 1.0 - u * u, 0.5 * u * (u + 1.0)]
    }

    /// Weights of the samples before, in the middle and after, for velocities, 1/s.
    pub fn velocity_weights(self, interval_s: f64) -> [f64; 3] {
        let u = self.fraction;
        [u - 0.5, -2.0 * u, u + 0.5].map(|weight| weight / interval_s)
    }
}

impl HeightLimit {
    /// Returns true if the limit applies to a sample: a sample in the time span, or one of the two around it. The end of a
    /// period counts as sample 0.
    pub fn holds_at(&self, motion: &Motion, sample: usize) -> bool {
        let h = motion.interval_s();
        let span = (self.from_s / h + 1e-6).floor()..=(self.to_s / h - 1e-6).ceil();
        let again = motion.ends == Ends::Periodic
            && span.contains(&((sample + motion.stance.len()) as f64));
        again || span.contains(&(sample as f64))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::motion::Subject;
    use crate::test_robots;

    fn motion(ends: Ends) -> Motion {
        // Five samples in 0.5 s: 0.1 s apart if periodic, 0.125 s if not.
        test_robots::motion(&test_robots::all()[0], ends)
    }

    #[test]
    fn moments_reproduce_parabolas_between_samples() {
        let parabola = |t: f64| 0.3 - 1.2 * t + 2.5 * t * t;
        let slope = |t: f64| -1.2 + 5.0 * t;
        for ends in [Ends::Periodic, Ends::AtRest] {
            let motion = motion(ends);
            let h = motion.interval_s();
            for at_s in [0.0, 0.03, 0.1, 0.1799, 0.25, 0.33, 0.44, 0.5] {
                let moment = Moment::of(&motion, at_s);
                let near = |k: usize| parabola((moment.sample as f64 + k as f64 - 1.0) * h);
                let sum = |w: [f64; 3]| (0..3).map(|k| w[k] * near(k)).sum::<f64>();
                // The bound allows for rounding only.
                assert!((sum(moment.position_weights()) - parabola(at_s)).abs() < 1e-12);
                assert!((sum(moment.velocity_weights(h)) - slope(at_s)).abs() < 1e-12);
            }
        }
    }

    #[test]
    fn moments_need_no_samples_outside_motions_that_do_not_repeat() {
        let (rest, periodic) = (motion(Ends::AtRest), motion(Ends::Periodic));
        assert_eq!(Moment::of(&rest, 0.0), Moment { sample: 1, fraction: -1.0 });
        assert_eq!(Moment::of(&rest, 0.5), Moment { sample: 3, fraction: 1.0 });
        assert_eq!(Moment::of(&periodic, 0.0), Moment { sample: 0, fraction: 0.0 });
        assert_eq!(Moment::of(&periodic, 0.5), Moment { sample: 4, fraction: 1.0 });
        assert_eq!(Moment::of(&periodic, 0.300_000_01).fraction, 0.0);
    }

    #[test]
    fn heights_hold_at_the_samples_that_enclose_their_span() {
        let periodic = motion(Ends::Periodic);
        let limit = |from_s, to_s| HeightLimit {
            of: Subject::Body,
            from_s,
            to_s,
            above_m: None,
            below_m: Some(0.1),
        };
        let held = |from_s, to_s| -> Vec<usize> {
            (0..5).filter(|&i| limit(from_s, to_s).holds_at(&periodic, i)).collect()
        };
        assert_eq!(held(0.1, 0.3), [1, 2, 3]);
        assert_eq!(held(0.11, 0.29), [1, 2, 3]);
        assert_eq!(held(0.09, 0.31), [0, 1, 2, 3, 4]);
        // Sample 5 is sample 0 of the next period, whose height is that of sample 0.
        assert_eq!(held(0.35, 0.5), [0, 3, 4]);
    }
}
