//! Functional objectives (sec. 2.4.1): displacement of the centre of mass, m, and change of heading, rad, over the motion. One
//! row for each component of the goal.
//!
//! The thesis weights them by 50 against the other terms and falls short by 0.1–3 %. As constraints, they are met exactly
//! without additional effort.

use crate::families::Family;
use crate::formulation::rows::{Role, RowWriter, Window};
use crate::formulation::{Span, Term, TermInfo};
use rollwalk_multibody::euler::BASE_YAW;

/// Constraint: displacement along and to the left of the initial heading. The anchor makes these world x and y.
pub struct Displacement;

/// Constraint: change of heading.
pub struct Turn;

impl Term for Displacement {
    fn info(&self) -> TermInfo {
        TermInfo { family: Family::DisplacementGoal, span: Span::Ends }
    }

    fn write(&self, window: &Window, out: &mut RowWriter) {
        out.set(1.0, Role::Equality);
        let [_, first, last] = window.states;
        let goal = &window.problem.goal;
        let goals = [("forward_m", goal.forward_m), ("left_m", goal.left_m)];
        for (c, (field, wanted)) in goals.into_iter().enumerate() {
            let Some(wanted) = wanted else { continue };
            for (k, state, sign) in [(1, first, -1.0), (2, last, 1.0)] {
                for (dof, column) in state.pose.d_com.iter().enumerate() {
                    if dof >= 3 || dof == c {
                        out.d(k, dof, sign * column[c]);
                    }
                }
            }
            out.given(field, wanted, -1.0);
            out.row(last.pose.com[c] - first.pose.com[c] - wanted);
        }
    }
}

impl Term for Turn {
    fn info(&self) -> TermInfo {
        TermInfo { family: Family::TurningGoal, span: Span::Ends }
    }

    fn write(&self, window: &Window, out: &mut RowWriter) {
        let Some(wanted) = window.problem.goal.turn_rad else { return };
        out.set(1.0, Role::Equality);
        out.d(1, BASE_YAW, -1.0);
        out.d(2, BASE_YAW, 1.0);
        let [_, first, last] = window.states;
        out.given("turn_rad", wanted, -1.0);
        out.row(last.vars[BASE_YAW] - first.vars[BASE_YAW] - wanted);
    }
}
