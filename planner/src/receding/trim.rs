//! Trim of the steering of a [`Course`](super::Course), as of a boat that drifts: how much more has to be wanted so that the robot comes to what is wanted.
//!
//! Velocities are approached by cost, and legs that have to leave their posture for every step are held back by theirs: LegBot
//! walks at 62 % of what is wanted. The part that is missing is integrated, slowly enough that the sway of a gait hardly counts, and against a velocity
//! that follows the wanted one as late as robots do, so that a new command does not wind it up.

use super::Steering;

/// Time in which the part that is missing is taken back, s.
const TAKES_S: f64 = 2.0;
/// Time in which a robot comes to a new velocity, s.
const FOLLOWS_S: f64 = 0.4;
/// Velocity below which nothing is trimmed, m/s and rad/s.
const LEAST: f64 = 0.02;
/// Range of the trim: more than this, and something else holds the robot back.
const RANGE: (f64, f64) = (-0.3, 1.5);

/// Trim of forward, left and turn.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Trim {
    /// What is added, as a part of what is wanted.
    part: [f64; 3],
    /// The velocity that is expected.
    expected: [f64; 3],
}

impl Trim {
    /// Steering with the trim.
    pub fn apply(&self, wanted: Steering) -> Steering {
        let [forward, left, turn] = self.part.map(|part| 1.0 + part);
        Steering {
            forward_m_s: forward * wanted.forward_m_s,
            left_m_s: left * wanted.left_m_s,
            turn_rad_s: turn * wanted.turn_rad_s,
        }
    }

    /// The robot came to a velocity in a stretch, on the mean.
    pub fn see(&mut self, wanted: Steering, velocity: [f64; 3], stretch_s: f64) {
        let wanted = [wanted.forward_m_s, wanted.left_m_s, wanted.turn_rad_s];
        for (c, wanted) in wanted.into_iter().enumerate() {
            let follows = 1.0 - (-stretch_s / FOLLOWS_S).exp();
            self.expected[c] += follows * (wanted - self.expected[c]);
            if wanted.abs() > LEAST {
                let missing = (self.expected[c] - velocity[c]) / wanted;
                let part = self.part[c] + stretch_s / TAKES_S * missing;
                self.part[c] = part.clamp(RANGE.0, RANGE.1);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Velocity of a robot that comes to a part of what is asked for, with its lag, after a time.
    fn comes_to(part: f64, wanted: f64, duration_s: f64) -> (f64, f64) {
        let (stretch_s, mut trim, mut velocity, mut most) = (0.15, Trim::default(), 0.0, 0.0_f64);
        let wanted = Steering { forward_m_s: wanted, ..Steering::default() };
        for _ in 0..(duration_s / stretch_s) as usize {
            let asked = trim.apply(wanted).forward_m_s;
            velocity += (1.0 - (-stretch_s / FOLLOWS_S).exp()) * (part * asked - velocity);
            most = most.max(velocity.abs());
            trim.see(wanted, [velocity, 0.0, 0.0], stretch_s);
        }
        (velocity, most)
    }

    #[test]
    fn what_is_missing_is_made_up_for_within_bounds() {
        for wanted in [0.2, -0.2] {
            let (velocity, most) = comes_to(0.6, wanted, 30.0);
            assert!((velocity / wanted - 1.0).abs() < 0.02 && most < 0.21, "{velocity} {most}");
            // One that follows is not driven beyond what is wanted, one that is blocked not without end.
            let (velocity, most) = comes_to(1.0, wanted, 30.0);
            assert!((velocity / wanted - 1.0).abs() < 1e-6 && most < 0.2001, "{velocity} {most}");
            assert!(comes_to(0.1, wanted, 300.0).1 < 0.051);
        }
        let small = Steering { left_m_s: 0.01, ..Steering::default() };
        let mut trim = Trim::default();
        (0..100).for_each(|_| trim.see(small, [0.0; 3], 0.15));
        assert_eq!(trim.apply(small), small);
    }
}
