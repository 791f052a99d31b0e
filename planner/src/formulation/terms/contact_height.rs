//! Height of contact points above the ground (Eq. 2.9), e_z − h(e_x, e_y): 0 in stance, the profile of [`crate::motion::swing`]
//! in swing. One row per end effector and sample, m.

use crate::families::Family;
use crate::formulation::rows::{Role, RowWriter, Subject, Window};
use crate::formulation::{Span, Term, TermInfo};

/// Constraint: height of contact points above the ground.
pub struct ContactHeight;

impl Term for ContactHeight {
    fn info(&self) -> TermInfo {
        TermInfo { family: Family::ContactHeight, span: Span::Samples }
    }

    fn write(&self, window: &Window, out: &mut RowWriter) {
        out.set(1.0, Role::Equality);
        for (j, ee) in window.problem.layout.end_effectors.iter().enumerate() {
            let ground = &window.states[1].frames[j].ground;
            let above_m = window.states[1].vars[ee.position + 2] - ground.height_m;
            out.d_height(1, ee.position, 1.0, ground);
            let height = window.problem.height_m[window.at[1]][j];
            out.row_of(Subject::EndEffector(j), above_m - height);
        }
    }
}
