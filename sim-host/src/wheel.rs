//! The speed loop inside a wheel drive: proportional-integral, critically damped.
//!
//! ```text
//!   tau = kd (w* - w) + ki ∫ (w* - w) dt        ki = kd² / (4 I)
//! ```
//!
//! The integral is kept as the angle by which the wheel is behind an ideal one that turns at w*, and
//! is bounded so that it alone never asks for more torque than the motor has. A step of w* is answered
//! with w = w* (1 - e^(-pt) (1 - pt)), p = kd / (2 I): the drive is of second order.

use crate::plant::{PdLaw, Plant};

/// State of the loop.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct SpeedLoop {
    /// Angle of the ideal wheel minus that of the real one, rad.
    behind_rad: f64,
}

impl SpeedLoop {
    /// Forgets the past: for a drive that starts to drive.
    pub fn reset(&mut self) {
        self.behind_rad = 0.0;
    }

    /// Lets `dt_s` pass at a demanded speed with gain `kd_nm_s_rad`.
    pub fn step(&mut self, plant: &mut Plant, speed_rad_s: f64, kd_nm_s_rad: f64, dt_s: f64) {
        let ki = kd_nm_s_rad * kd_nm_s_rad / (4.0 * plant.inertia_kg_m2());
        let start_rad = plant.position_rad;
        let law = PdLaw {
            // Half a step ahead, because the plant evaluates the law at the middle of the step.
            position_rad: start_rad + self.behind_rad + 0.5 * dt_s * speed_rad_s,
            speed_rad_s,
            kp_nm_rad: ki,
            kd_nm_s_rad,
            torque_nm: 0.0,
        };
        plant.step(&law, dt_s);
        self.behind_rad += dt_s * speed_rad_s - (plant.position_rad - start_rad);
        if ki > 0.0 {
            let bound = plant.torque_max_nm() / ki;
            self.behind_rad = self.behind_rad.clamp(-bound, bound);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rollwalk_robot::Actuator;

    const DT_S: f64 = 0.5e-3;

    fn drive(torque_max_nm: f64) -> Plant {
        let actuator = Actuator {
            model: "test".into(),
            speed_max_rad_s: 20.0,
            torque_max_nm,
            kp_nm_rad: 0.0,
            kd_nm_s_rad: 0.2,
            armature_kg_m2: 0.004,
            bus: 0,
            id: 1,
        };
        Plant::new(&actuator, 0.0)
    }

    #[test]
    fn step_response_follows_the_closed_form() {
        let (mut plant, mut speed_loop) = (drive(1e9), SpeedLoop::default());
        let p = 0.2 / (2.0 * 0.004);
        for k in 1..=1000 {
            speed_loop.step(&mut plant, 6.0, 0.2, DT_S);
            let decay = p * k as f64 * DT_S;
            let expected = 6.0 * (1.0 - (-decay).exp() * (1.0 - decay));
            // Midpoint rule at p dt = 0.0125: relative error about (p dt)²/4 = 4e-5.
            assert!((plant.speed_rad_s - expected).abs() < 6.0 * 8e-5, "step {k}");
        }
    }

    #[test]
    fn a_constant_load_is_carried_without_speed_error() {
        let (mut plant, mut speed_loop) = (drive(2.0), SpeedLoop::default());
        plant.load_torque_nm = -0.7;
        for _ in 0..4000 {
            speed_loop.step(&mut plant, 6.0, 0.2, DT_S);
        }
        assert!((plant.speed_rad_s - 6.0).abs() < 1e-6);
        assert!((plant.torque_nm - 0.7).abs() < 1e-6);
    }

    #[test]
    fn a_blocked_wheel_does_not_wind_up() {
        let (mut plant, mut speed_loop) = (drive(1.0), SpeedLoop::default());
        plant.load_torque_nm = -1.0;
        for _ in 0..20_000 {
            speed_loop.step(&mut plant, 6.0, 0.2, DT_S);
        }
        // Freed after ten seconds, it settles as after any step: the most that it can be behind is
        // 1 N·m / ki = 0.4 rad, and a second is 25 time constants.
        plant.load_torque_nm = 0.0;
        for _ in 0..2000 {
            speed_loop.step(&mut plant, 6.0, 0.2, DT_S);
        }
        assert!((plant.speed_rad_s - 6.0).abs() < 1e-6, "{}", plant.speed_rad_s);
    }
}
