//! Agreement of wheel axes with the links that carry them (Eq. 2.13): φ_b(â, q) − a(α) = 0. Three rows per wheel and sample.
//! The length of the difference is an angle, rad.

use crate::families::Family;
use crate::formulation::rows::{Role, RowWriter, Subject, Window};
use crate::formulation::{Span, Term, TermInfo};
use crate::problem::state::d_yaw;

/// Constraint: agreement of wheel axes with their links.
pub struct WheelAxis;

impl Term for WheelAxis {
    fn info(&self) -> TermInfo {
        TermInfo { family: Family::WheelAxis, span: Span::Samples }
    }

    fn write(&self, window: &Window, out: &mut RowWriter) {
        let problem = window.problem;
        let here = window.states[1];
        out.set(1.0, Role::Equality);
        for (j, ee) in problem.layout.end_effectors.iter().enumerate() {
            let Some(wheel) = ee.wheel else { continue };
            let (mount, frame) = (&here.pose.end_effectors[j], &here.frames[j]);
            for c in 0..3 {
                for (&dof, d) in problem.model.chain(j).dofs.iter().zip(&mount.d_axis).skip(3) {
                    out.d(1, dof, d[c]);
                }
                out.d(1, wheel.tilt, -frame.d_axis_tilt[c]);
                out.d(1, wheel.yaw, -d_yaw(&frame.axis)[c]);
                out.row_of(Subject::EndEffector(j), mount.axis[c] - frame.axis[c]);
            }
        }
    }
}
