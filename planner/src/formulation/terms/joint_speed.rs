//! Limits of joint speeds. Two inequality rows per joint and interval, rad/s.

use crate::families::Family;
use crate::formulation::rows::{Role, RowWriter, Subject, Window};
use crate::formulation::{Span, Term, TermInfo};
use rollwalk_multibody::euler::JOINTS;

/// Constraint: limits of joint speeds.
pub struct JointSpeed;

/// Half-width of the smoothing of Eq. 2.16, as a fraction of the limit (thesis: 10 %).
pub(super) const BAND_FRACTION: f64 = 0.1;

impl Term for JointSpeed {
    fn info(&self) -> TermInfo {
        TermInfo { family: Family::JointSpeed, span: Span::Intervals }
    }

    fn write(&self, window: &Window, out: &mut RowWriter) {
        let h = window.problem.interval_s;
        let [_, here, after] = window.states;
        for (j, joint) in window.problem.model.robot().joints.iter().enumerate() {
            let limit = joint.actuator.speed_max_rad_s;
            let usable = window.problem.reserve.speed_use;
            out.set(limit, Role::Inequality { band: BAND_FRACTION });
            let speed = (after.vars[JOINTS + j] - here.vars[JOINTS + j]) / h;
            for sign in [1.0, -1.0] {
                out.d(1, JOINTS + j, -sign / h);
                out.d(2, JOINTS + j, sign / h);
                out.given("speed_max_rad_s", limit, -usable);
                out.row_of(Subject::Joint(j), sign * speed - usable * limit);
            }
        }
    }
}
