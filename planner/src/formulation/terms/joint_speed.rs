//! Speed limits of the motors of joints. Two inequality rows per motor and interval, rad/s.

use crate::families::Family;
use crate::formulation::rows::{Role, RowWriter, Subject, Window};
use crate::formulation::{Span, Term, TermInfo};
use rollwalk_multibody::euler::JOINTS;
use rollwalk_robot::JointRatio;

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
        let [_, here, after] = window.states;
        let tree = window.problem.model.tree();
        for (j, joint) in tree.robot().joints.iter().enumerate() {
            let ratios = tree.transmission().ratios(j);
            let limit = joint.actuator.speed_max_rad_s;
            let usable = window.problem.reserve.speed_use;
            out.set(limit, Role::Inequality { band: BAND_FRACTION });
            let speed = |of: &JointRatio| {
                of.ratio * ((after.vars[JOINTS + of.joint] - here.vars[JOINTS + of.joint]) / h)
            };
            let speed: f64 = ratios.iter().map(speed).sum();
            for sign in [1.0, -1.0] {
                for of in ratios {
                    out.d(1, JOINTS + of.joint, of.ratio * (-sign / h));
                    out.d(2, JOINTS + of.joint, of.ratio * (sign / h));
                }
                out.given("speed_max_rad_s", limit, -usable);
                out.row_of(Subject::Joint(j), sign * speed - usable * limit);
            }
        }
    }
}
