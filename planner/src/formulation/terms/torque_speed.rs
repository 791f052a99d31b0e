//! Torque-speed lines of motors: |τ/τ_stall + q̇/ω₀| ≤ 1. One dimensionless inequality row per motor and interval. Joints use the
//! torque at the first sample of the interval and the mean speed over both intervals around this sample. Wheels use values at the
//! middle of the interval.
//!
//! When a motor drives its load, τ and q̇ have the same sign, and the row is the torque-speed line. When the motor brakes, the
//! two partly cancel. The row is then satisfied whenever torque and speed are within their limits, which do not exceed the ends
//! of the line.

use super::joint_torque::{BAND_FRACTION, MotorTorque};
use super::motor_motion;
use super::wheel_speed::MotorSpeed;
use super::wheel_torque;
use crate::families::Family;
use crate::formulation::rows::{Role, RowWriter, Subject, Window};
use crate::formulation::{Span, Term, TermInfo};

/// Constraint: torque-speed lines of motors.
pub struct TorqueSpeed;

impl Term for TorqueSpeed {
    fn info(&self) -> TermInfo {
        TermInfo { family: Family::TorqueSpeedLine, span: Span::Intervals }
    }

    fn write(&self, window: &Window, out: &mut RowWriter) {
        let problem = window.problem;
        let robot = problem.model.robot();
        let h = problem.interval_s;
        out.set(1.0, Role::Inequality { band: BAND_FRACTION });
        for (j, joint) in robot.joints.iter().enumerate() {
            let Some(line) = joint.actuator.torque_speed else { continue };
            if out.skips_row() {
                continue;
            }
            let (torque_nm, derivative) = MotorTorque::for_row(window, j, out);
            let speed_rad_s = motor_motion::mean_speed(window, [0, 2], j, 2.0 * h);
            let used = torque_nm / line.stall_torque_nm + speed_rad_s / line.no_load_speed_rad_s;
            if let Some(derivative) = derivative {
                let sign = used.signum();
                derivative.differentiate(sign / line.stall_torque_nm, out);
                let d_angle = sign / line.no_load_speed_rad_s / (2.0 * h);
                motor_motion::differentiate(window, [0, 2], j, d_angle, out);
            }
            out.row_of(Subject::Joint(j), used.abs() - 1.0);
        }
        for (j, ee) in robot.end_effectors.iter().enumerate() {
            // A wheel that is held still has only its torque limit.
            let motor = ee.contact.actuator().filter(|_| !problem.held[j]);
            let Some(line) = motor.and_then(|motor| motor.torque_speed) else { continue };
            let Some(speed) = MotorSpeed::new(window, j) else { continue };
            let torque_nm = 0.5
                * (wheel_torque::torque_nm(window, 1, j) + wheel_torque::torque_nm(window, 2, j));
            let used =
                torque_nm / line.stall_torque_nm + speed.speed_rad_s / line.no_load_speed_rad_s;
            let sign = used.signum();
            for k in [1, 2] {
                let factor = 0.5 * sign / line.stall_torque_nm;
                wheel_torque::differentiate(window, k, j, factor, out);
            }
            speed.differentiate(sign / line.no_load_speed_rad_s, out);
            out.row_of(Subject::EndEffector(j), used.abs() - 1.0);
        }
    }
}
