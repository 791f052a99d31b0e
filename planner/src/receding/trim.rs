//! Correction of the steering command of a [`Course`](super::Course): integral control of the planned velocity.
//!
//! A horizon tracks the commanded velocity by a cost, in balance with the posture cost. Legs that leave their posture in every
//! step therefore walk too slowly. One integrator per axis and gait scales the command up. It integrates only while the command
//! is held and the response to its latest change has settled, so that transients do not wind it up. A rejected plan halves the
//! correction, so that commands remain feasible.

use super::Steering;

/// Integral time, s.
const INTEGRAL_S: f64 = 1.0;
/// Time for which a command must be constant before the velocity error is integrated, s. Robots reach their velocity sooner, also
/// at the start of a gait.
const SETTLES_S: f64 = 1.5;
/// Largest relative change of a command that counts as constant.
const HELD: f64 = 0.1;
/// Smallest command that is corrected, m/s and rad/s. The error is divided by the command.
const LEAST: f64 = 0.02;
/// Range of the correction, as a fraction of the command. The range bounds the windup of a blocked robot.
const RANGE: (f64, f64) = (-0.3, 1.5);

/// Correction of forward velocity, velocity to the left and yaw rate.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Trim {
    /// Correction of each axis, as a fraction of the command.
    part: [f64; 3],
    /// Command since its latest change, m/s and rad/s.
    held: [f64; 3],
    /// Time since that change, s.
    held_s: f64,
}

impl Trim {
    /// Returns the corrected command.
    pub fn apply(&self, wanted: Steering) -> Steering {
        let [forward, left, turn] = self.part.map(|part| 1.0 + part);
        Steering {
            forward_m_s: forward * wanted.forward_m_s,
            left_m_s: left * wanted.left_m_s,
            turn_rad_s: turn * wanted.turn_rad_s,
        }
    }

    /// Updates the correction with the mean planned velocity of the played part of a horizon, minus the sway of the gait: forward
    /// and left, m/s, and yaw rate, rad/s.
    pub fn update(&mut self, wanted: Steering, velocity: [f64; 3], stretch_s: f64) {
        let wanted = [wanted.forward_m_s, wanted.left_m_s, wanted.turn_rad_s];
        let mut axes = wanted.iter().zip(&self.held);
        if axes.any(|(wanted, held)| (wanted - held).abs() > HELD * wanted.abs().max(LEAST)) {
            (self.held, self.held_s) = (wanted, 0.0);
        }
        self.held_s += stretch_s;
        if self.held_s <= SETTLES_S {
            return;
        }
        for ((part, wanted), velocity) in self.part.iter_mut().zip(wanted).zip(velocity) {
            if wanted.abs() > LEAST {
                let error = (wanted - velocity) / wanted;
                *part = (*part + stretch_s / INTEGRAL_S * error).clamp(RANGE.0, RANGE.1);
            }
        }
    }

    /// Halves the correction after a rejected plan.
    pub fn reject(&mut self) {
        self.part = self.part.map(|part| 0.5 * part);
        self.restart();
    }

    /// Restarts the settling time after a change of gait.
    pub fn restart(&mut self) {
        self.held_s = 0.0;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const STRETCH_S: f64 = 0.15;

    /// Robot whose forward velocity follows commands with a first-order lag.
    struct Plant {
        lag_s: f64,
        /// Steady-state velocity, as a fraction of the command.
        gain: f64,
        velocity_m_s: f64,
        trim: Trim,
    }

    impl Plant {
        fn new(lag_s: f64, gain: f64) -> Self {
            Self { lag_s, gain, velocity_m_s: 0.0, trim: Trim::default() }
        }

        /// Steers the robot for `duration_s`. Returns the smallest and the largest velocity.
        fn steer(&mut self, wanted_m_s: f64, duration_s: f64) -> (f64, f64) {
            let wanted = Steering { forward_m_s: wanted_m_s, ..Steering::default() };
            let (mut least, mut most) = (f64::INFINITY, f64::NEG_INFINITY);
            for _ in 0..(duration_s / STRETCH_S).round() as usize {
                let goal = self.gain * self.trim.apply(wanted).forward_m_s;
                self.velocity_m_s +=
                    (1.0 - (-STRETCH_S / self.lag_s).exp()) * (goal - self.velocity_m_s);
                (least, most) = (least.min(self.velocity_m_s), most.max(self.velocity_m_s));
                self.trim.update(wanted, [self.velocity_m_s, 0.0, 0.0], STRETCH_S);
            }
            (least, most)
        }
    }

    #[test]
    fn a_steady_state_error_is_corrected_within_bounds() {
        for lag_s in [0.1, 0.4, 0.8] {
            for wanted in [0.2, -0.2] {
                let mut slow = Plant::new(lag_s, 0.6);
                let (least, most) = slow.steer(wanted, 30.0);
                assert!((slow.velocity_m_s / wanted - 1.0).abs() < 0.02, "{}", slow.velocity_m_s);
                assert!(least.abs().max(most.abs()) < 0.21, "{lag_s}: {least} {most}");
            }
            let mut fast = Plant::new(lag_s, 1.2);
            fast.steer(0.2, 30.0);
            assert!((fast.velocity_m_s - 0.2).abs() < 0.002, "{}", fast.velocity_m_s);
            // The correction of a blocked robot is bounded.
            assert!(Plant::new(lag_s, 0.1).steer(0.2, 300.0).1 < 0.051);
        }
    }

    #[test]
    fn a_change_of_the_command_does_not_wind_up() {
        for lag_s in [0.1, 0.4, 0.6] {
            let mut plant = Plant::new(lag_s, 1.0);
            for wanted in [0.2, 0.04, 0.2, -0.2, 0.0, 0.4] {
                plant.steer(wanted, 6.0);
                let part = plant.trim.part[0];
                assert!(part.abs() < 0.12, "{lag_s} s, {wanted} m/s: {part}");
            }
            // A stick that is tapped, and a stick that moves all the time.
            let mut plant = Plant::new(lag_s, 1.0);
            for k in 0..50 {
                plant.steer(if k % 2 == 0 { 0.2 } else { 0.0 }, 1.05);
            }
            for k in 0..50 {
                plant.steer(0.02 + 0.01 * f64::from(k % 5), 0.3);
            }
            assert_eq!(plant.trim.part[0], 0.0);
        }
    }

    #[test]
    fn small_commands_are_left_alone_and_a_rejected_plan_halves_the_correction() {
        let small = Steering { left_m_s: 0.01, ..Steering::default() };
        let mut trim = Trim::default();
        (0..100).for_each(|_| trim.update(small, [0.0; 3], STRETCH_S));
        assert_eq!(trim.apply(small), small);
        let turn = Steering { turn_rad_s: 0.3, ..Steering::default() };
        (0..100).for_each(|_| trim.update(turn, [0.0; 3], STRETCH_S));
        assert_eq!(trim.apply(turn).turn_rad_s, 2.5 * 0.3);
        trim.reject();
        assert_eq!(trim.apply(turn).turn_rad_s, 1.75 * 0.3);
    }
}
