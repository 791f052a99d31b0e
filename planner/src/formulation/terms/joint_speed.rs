//! Speed limits of the motors of joints. Two inequality rows per motor and interval, rad/s.

use super::motor_motion::{differentiate, mean_speed};
use crate::families::Family;
use crate::formulation::rows::{Role, RowWriter, Subject, Window};
use crate::formulation::{Span, Term, TermInfo};

/// Constraint: speed limits of the motors of joints.
pub struct JointSpeed;

/// Half-width of the smoothing of Eq. 2.16, as a fraction of the limit (thesis: 10 %).
pub(super) const BAND_FRACTION: f64 = 0.1;

impl Term for JointSpeed {
    fn info(&self) -> TermInfo {
        TermInfo { family: Family::JointSpeed, span: Span::Intervals }
    }

    fn write(&self, window: &Window, out: &mut RowWriter) {
        let h = window.problem.interval_s;
        let robot = window.problem.model.robot();
        for (j, joint) in robot.driven_joints().map(|j| (j, &robot.joints[j])) {
            let limit = joint.actuator.speed_max_rad_s;
            let usable = window.problem.reserve.speed_use;
            out.set(limit, Role::Inequality { band: BAND_FRACTION });
            let speed = mean_speed(window, [1, 2], j, h);
            for sign in [1.0, -1.0] {
                differentiate(window, [1, 2], j, sign / h, out);
                out.given("speed_max_rad_s", limit, -usable);
                out.row_of(Subject::Joint(j), sign * speed - usable * limit);
            }
        }
    }
}
