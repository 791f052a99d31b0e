//! Zero ground force in swing (Eq. 2.7): f = 0. Three rows per end effector and sample, N.

use crate::families::Family;
use crate::formulation::rows::{Role, RowWriter, Subject, Window};
use crate::formulation::{Span, Term, TermInfo};

/// Constraint: ground forces in swing.
pub struct SwingForce;

impl Term for SwingForce {
    fn info(&self) -> TermInfo {
        TermInfo { family: Family::SwingForce, span: Span::Samples }
    }

    fn write(&self, window: &Window, out: &mut RowWriter) {
        out.set(window.problem.force_scale_n(), Role::Equality);
        for (j, ee) in window.problem.layout.end_effectors.iter().enumerate() {
            if window.stance(1, j) {
                continue;
            }
            // The force is not zero while the warm start unloads the feet.
            let kept = window.swing_force_n.get(window.at[1]).map(|forces| forces[j]);
            let wanted = kept.unwrap_or_default();
            for c in 0..3 {
                out.d(1, ee.force + c, 1.0);
                let residual = window.states[1].vars[ee.force + c] - wanted[c];
                out.row_of(Subject::EndEffector(j), residual);
            }
        }
    }
}
