//! Agreement of contact points with the limbs (Eq. 2.14): φ_b(l̂, q) + ρ(α) − e = 0. Three rows per end effector and sample, m.

use crate::families::Family;
use crate::formulation::rows::{Role, RowWriter, Subject, Window};
use crate::formulation::{Span, Term, TermInfo};

/// Constraint: agreement of contact points with the limbs.
pub struct ContactPoint;

impl Term for ContactPoint {
    fn info(&self) -> TermInfo {
        TermInfo { family: Family::ContactPoint, span: Span::Samples }
    }

    fn write(&self, window: &Window, out: &mut RowWriter) {
        let problem = window.problem;
        let here = window.states[1];
        out.set(1.0, Role::Equality);
        for (j, ee) in problem.layout.end_effectors.iter().enumerate() {
            let (mount, frame) = (&here.pose.end_effectors[j], &here.frames[j]);
            let residual = mount.center + frame.to_contact - here.vector(ee.position);
            for c in 0..3 {
                let chain = problem.model.chain(j).dofs.iter().zip(&mount.d_center);
                for (column, (&dof, d_center)) in chain.enumerate() {
                    // The base position moves the wheel along itself only.
                    if column >= 3 || column == c {
                        out.d(1, dof, d_center[c]);
                    }
                }
                if let Some(wheel) = ee.wheel {
                    let [d_tilt, d_yaw] = frame.d_to_contact;
                    out.d(1, wheel.tilt, d_tilt[c]);
                    out.d(1, wheel.yaw, d_yaw[c]);
                }
                if let Some(slope) = &frame.by_normal {
                    out.d_normal(1, j, &slope.d_to_contact.row(c).transpose());
                }
                out.d(1, ee.position + c, -1.0);
                out.row_of(Subject::EndEffector(j), residual[c]);
            }
        }
    }
}
