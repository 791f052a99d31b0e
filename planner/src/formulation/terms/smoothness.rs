//! Smoothness of the motion (sec. 2.4.1, regularisers): second differences q₋ − 2q + q₊ of base and joints. One cost
//! row per degree of freedom and sample, m or rad.

use crate::families::Family;
use crate::formulation::rows::{Role, RowWriter, Window};
use crate::formulation::{Span, Term, TermInfo};

/// Cost: second differences of base and joints.
pub struct Smoothness;

impl Term for Smoothness {
    fn info(&self) -> TermInfo {
        TermInfo { family: Family::Smoothness, span: Span::Samples }
    }

    fn write(&self, window: &Window, out: &mut RowWriter) {
        let weight = window.problem.weights.smoothness * window.problem.per_time(2);
        out.set(1.0, Role::Cost { weight });
        let [before, here, after] = window.states.map(|s| &s.vars);
        for dof in 0..window.problem.layout.dofs {
            out.d(0, dof, 1.0);
            out.d(1, dof, -2.0);
            out.d(2, dof, 1.0);
            out.row(before[dof] - 2.0 * here[dof] + after[dof]);
        }
    }
}
