//! Limits of joint angles. Two inequality rows per joint and sample, rad.

use crate::families::Family;
use crate::formulation::rows::{Role, RowWriter, Subject, Window};
use crate::formulation::{Span, Term, TermInfo};
use rollwalk_multibody::euler::JOINTS;

/// Constraint: limits of joint angles.
pub struct JointLimit;

/// Half-width of the smoothing of Eq. 2.16, rad.
const BAND_RAD: f64 = 0.05;

impl Term for JointLimit {
    fn info(&self) -> TermInfo {
        TermInfo { family: Family::JointLimit, span: Span::Samples }
    }

    fn write(&self, window: &Window, out: &mut RowWriter) {
        out.set(1.0, Role::Inequality { band: BAND_RAD });
        for (j, joint) in window.problem.model.robot().joints.iter().enumerate() {
            let angle = window.states[1].vars[JOINTS + j];
            out.d(1, JOINTS + j, 1.0);
            out.row_of(Subject::Joint(j), angle - joint.position_max_rad);
            out.d(1, JOINTS + j, -1.0);
            out.row_of(Subject::Joint(j), joint.position_min_rad - angle);
        }
    }
}
