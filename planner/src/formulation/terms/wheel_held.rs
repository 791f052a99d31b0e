//! Welded wheels, and driven wheels that a motion holds still, do not turn relative to their link. One equality row per wheel
//! and interval: the motor speed at the rim, m/s.
//!
//! The row replaces Eq. 2.15, a cross product of reference vectors of the link at both ends of the interval. That product depends
//! on the choice of vectors unless the link turns about the wheel's axis alone. On a pitched shank, it forbids the foot to tilt
//! and to yaw. A motor only turns the wheel about its axis a. The row is therefore the turn about this axis alone,
//! ω h + Δα_yaw (v·a) − a·log(R₊Rᵀ) with the vertical v.

use super::wheel_speed::MotorSpeed;
use crate::families::Family;
use crate::formulation::rows::{Role, RowWriter, Subject, Window};
use crate::formulation::{Span, Term, TermInfo};

/// Constraint: wheels that do not turn relative to their link.
pub struct WheelHeld;

impl Term for WheelHeld {
    fn info(&self) -> TermInfo {
        TermInfo { family: Family::HeldWheel, span: Span::Intervals }
    }

    fn write(&self, window: &Window, out: &mut RowWriter) {
        let problem = window.problem;
        out.set(1.0, Role::Equality);
        for (j, _) in problem.held.iter().enumerate().filter(|(_, held)| **held) {
            let Some(motor) = MotorSpeed::new(window, j) else { continue };
            let radius_m = problem.model.robot().end_effectors[j].radius_m;
            motor.differentiate(radius_m, out);
            out.row_of(Subject::EndEffector(j), radius_m * motor.speed_rad_s);
        }
    }
}

#[cfg(test)]
mod tests {
    use crate::families::Family;
    use crate::formulation::System;
    use crate::formulation::rows::Rows;
    use crate::motion::Ends;
    use crate::plan::Placement;
    use crate::problem::{Problem, Unknowns, Weights};
    use crate::test_robots;
    use nalgebra::{Rotation3, Vector3};
    use rollwalk_multibody::euler::{BASE_YAW, Model};

    const H_S: f64 = 1e-3;

    /// Worst rim speed relative to the link, m/s, of a wheel that is welded to the body with its axis along the body's y. The
    /// body's attitude is R_z(yaw) R_x(tilt) R_y(spin). Spin is the angle that ω counts: the turn about the axis relative to
    /// the tilting and yawing wheel frame.
    fn worst(tilt: fn(f64) -> f64, yaw: fn(f64) -> f64, spin: fn(f64) -> f64) -> f64 {
        worst_with(tilt, yaw, spin, 0.0)
    }

    /// Worst rim speed relative to the link, m/s, of a wheel that turns `faster_rad_s` faster than in [`worst`].
    fn worst_with(
        tilt: fn(f64) -> f64,
        yaw: fn(f64) -> f64,
        spin: fn(f64) -> f64,
        faster_rad_s: f64,
    ) -> f64 {
        let mut robot = test_robots::welded(&test_robots::all()[0]);
        robot.end_effectors.truncate(1);
        robot.end_effectors[0].link = 0;
        let mut motion = test_robots::motion(&robot, Ends::AtRest);
        motion.duration_s = H_S * (motion.stance.len() - 1) as f64;
        let problem = Problem::new(Model::new(&robot), &motion, Weights::default());
        let wheel = problem.layout.end_effectors[0].wheel.expect("a wheel");
        let slots = (0..problem.samples)
            .map(|i| {
                let t = 0.4 + i as f64 * H_S;
                let about = |axis, angle| Rotation3::from_axis_angle(&axis, angle);
                let attitude = about(Vector3::z_axis(), yaw(t))
                    * about(Vector3::x_axis(), tilt(t))
                    * about(Vector3::y_axis(), spin(t));
                let (roll, pitch, heading) = attitude.euler_angles();
                let mut vars = nalgebra::DVector::zeros(problem.layout.len);
                for (c, angle) in [heading, pitch, roll].into_iter().enumerate() {
                    vars[BASE_YAW + c] = angle;
                }
                vars[wheel.tilt] = tilt(t);
                vars[wheel.yaw] = yaw(t);
                vars[wheel.speed] = (spin(t + H_S) - spin(t)) / H_S + faster_rad_s;
                vars
            })
            .collect();
        let unknowns = Unknowns { slots, placement: Placement::default() };
        let rows = System::new(&problem).rows(&unknowns, Rows::default());
        let held: Vec<f64> = rows
            .iter()
            .filter(|(row, _)| row.family == Family::HeldWheel)
            .map(|(_, value)| value.abs())
            .collect();
        assert_eq!(held.len(), 4);
        held.into_iter().fold(0.0, f64::max)
    }

    #[test]
    fn a_welded_wheel_may_tilt_yaw_and_roll_with_its_link_and_not_otherwise() {
        let tilt = |t: f64| 0.3 + 0.5 * t;
        let yaw = |t: f64| 0.8 * t;
        let spin = |t: f64| 0.6 * t * t;
        // Midpoint rule: h² times third derivatives of order 1, times the radius of 0.05 m.
        assert!(worst(tilt, yaw, spin) < 1e-6);
        assert!(worst(tilt, yaw, |_| 0.0) < 1e-6);
    }

    #[test]
    fn the_row_is_the_rim_speed_that_a_motor_would_have() {
        // The wheel rolls at 2 rad/s more than its link.
        let radius_m = test_robots::all()[0].end_effectors[0].radius_m;
        let turning = worst_with(|t| 0.3 + 0.5 * t, |t| 0.8 * t, |t| 0.6 * t, 2.0);
        assert!((turning - 2.0 * radius_m).abs() < 1e-6, "{turning}");
    }
}
