//! Choreography: where the robot is to be at chosen times, and between which heights (thesis sec. 2.4.1,
//! "functional objectives"; sec. 3.5.2, ducking under a bar). Read by `choreography_file`.
//!
//! Everything is given in the frame of the start: origin on the ground below the body's origin at time 0,
//! forward along its heading there. Times need not fall on samples. Around a time the motion is the
//! parabola through the nearest sample and its two neighbours ([`Moment`]): for positions it is off by
//! about h³/16 · d³x/dt³, where a straight line would be off by h²/8 · d²x/dt². Heights over a span of
//! time hold at every sample of it and at the two that enclose it, so that straight lines between them
//! keep within it too.

use super::{Ends, Motion};
use rollwalk_robot::Robot;
use serde::{Deserialize, Serialize};

/// What a target or a height is about.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Subject {
    /// The centre of mass.
    Com,
    /// The origin of the body frame.
    Body,
    /// The contact point of an end effector, by its index in the robot.
    EndEffector(usize),
}

impl Subject {
    /// Its name, as motion files and reports write it.
    pub fn name(self, robot: &Robot) -> &str {
        match self {
            Self::Com => "com",
            Self::Body => "body",
            Self::EndEffector(j) => &robot.end_effectors[j].name,
        }
    }
}

/// Where something is to be at one time. `None` leaves the optimiser free.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Target {
    /// What.
    pub of: Subject,
    /// When, s.
    pub at_s: f64,
    /// Position forward, to the left and above the ground, m. The height of an end effector shapes the
    /// whole swing that it is in.
    pub position_m: [Option<f64>; 3],
    /// Velocity in the same directions, m/s.
    pub velocity_m_s: [Option<f64>; 3],
    /// Heading, rad, positive to the left, against that of the start; of the body only.
    pub heading_rad: Option<f64>,
}

/// Heights to keep between over a span of time, of the body or the centre of mass.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct HeightLimit {
    /// Whose height above the ground.
    pub of: Subject,
    /// Start of the span, s.
    pub from_s: f64,
    /// End of the span, s.
    pub to_s: f64,
    /// Lowest height, m.
    pub above_m: Option<f64>,
    /// Greatest height, m.
    pub below_m: Option<f64>,
}

/// A time on the grid of samples: `sample`, and how far beyond it in intervals. A motion that does not
/// repeat has no neighbours outside, so that its first and last half interval belong to the inner
/// sample; there the fraction goes to ±1.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Moment {
    /// The sample in the middle.
    pub sample: usize,
    /// Distance from it in intervals.
    pub fraction: f64,
}

impl Moment {
    /// Places a time of a motion.
    pub fn of(motion: &Motion, at_s: f64) -> Self {
        let samples = motion.stance.len();
        let (first, last) = match motion.ends {
            Ends::Periodic => (0, samples - 1),
            Ends::AtRest | Ends::Prescribed => (1, samples - 2),
        };
        let position = at_s / motion.interval_s();
        let sample = (position.round().max(0.0) as usize).clamp(first, last);
        let fraction = position - sample as f64;
        // Files write times with few digits: a rounded one still means its sample.
        let nearest = fraction.round();
        let on_sample = (fraction - nearest).abs() < 1e-6;
        Self { sample, fraction: if on_sample { nearest } else { fraction } }
    }

    /// The nearest sample. The end of a period is the first one.
    pub fn nearest(self, motion: &Motion) -> usize {
        let nearest = (self.sample as f64 + self.fraction).round() as usize;
        if motion.ends == Ends::Periodic { nearest % motion.stance.len() } else { nearest }
    }

    /// Weights of the sample before, the one in the middle and the one after it: of positions.
    pub fn position_weights(self) -> [f64; 3] {
        let u = self.fraction;
        [0.5 * u * (u - 1.0), 1.0 - u * u, 0.5 * u * (u + 1.0)]
    }

    /// The same of velocities, 1/s.
    pub fn velocity_weights(self, interval_s: f64) -> [f64; 3] {
        let u = self.fraction;
        [u - 0.5, -2.0 * u, u + 0.5].map(|weight| weight / interval_s)
    }
}

impl HeightLimit {
    /// Whether a sample must keep to it: those of the span and the two that enclose it. The end of a period
    /// is the first sample.
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
    use crate::test_robots;

    fn motion(ends: Ends) -> Motion {
        // Five samples in 0.5 s: 0.1 s apart if it repeats, 0.125 s if not.
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
                // Rounding only.
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
        // Sample 5 is sample 0 of the next period, whose height is that of this one's start.
        assert_eq!(held(0.35, 0.5), [0, 3, 4]);
    }
}
