//! Correction of the steering command of a [`Course`](super::Course): integral control of the planned velocity.
//!
//! A horizon tracks the commanded velocity by a cost, in balance with the posture cost. Legs that leave their posture in every step therefore
//! walk too slowly: LegBot at 62 % of the command. An integrator per axis scales the command up. Its time constant is longer than a gait
//! cycle, so that the sway of the gait averages out. Its error is taken against a first-order lag of the command, so that it does not wind
//! up after a step of the command.

use super::Steering;

/// Integral time, s.
const TAKES_S: f64 = 2.0;
/// Time constant of the lag with which velocity follows a command, s.
const FOLLOWS_S: f64 = 0.4;
/// Smallest command that is corrected, m/s and rad/s: the error is divided by it.
const LEAST: f64 = 0.02;
/// Range of the correction, as a fraction of the command: it bounds the windup of a robot that is blocked.
const RANGE: (f64, f64) = (-0.3, 1.5);

/// Correction of forward velocity, velocity to the left and yaw rate.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Trim {
    /// Correction of each axis, as a fraction of the command.
    part: [f64; 3],
    /// Command of each axis after the lag, m/s and rad/s.
    expected: [f64; 3],
}

impl Trim {
    /// The corrected command.
    pub fn apply(&self, wanted: Steering) -> Steering {
        let [forward, left, turn] = self.part.map(|part| 1.0 + part);
        Steering {
            forward_m_s: forward * wanted.forward_m_s,
            left_m_s: left * wanted.left_m_s,
            turn_rad_s: turn * wanted.turn_rad_s,
        }
    }

    /// Updates the correction with the mean planned velocity of a stretch: forward, left, m/s, and yaw rate, rad/s.
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

    /// Final and largest velocity of a first-order robot whose steady-state gain is `part`.
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
