//! Start of the motion at the world's origin, heading along x: x₁ = y₁ = yaw₁ = 0 for the base. Three rows per motion, m and
//! rad. Without them, any plan could be shifted and turned in the ground plane.

use crate::families::Family;
use crate::formulation::rows::{Role, RowWriter, Window};
use crate::formulation::{Span, Term, TermInfo};
use rollwalk_multibody::euler::{BASE_POSITION, BASE_YAW};

/// Constraint: start of the base at the origin with heading 0.
pub struct Anchor;

impl Term for Anchor {
    fn info(&self) -> TermInfo {
        TermInfo { family: Family::Anchor, span: Span::Ends }
    }

    fn write(&self, window: &Window, out: &mut RowWriter) {
        out.set(1.0, Role::Equality);
        for variable in [BASE_POSITION, BASE_POSITION + 1, BASE_YAW] {
            out.d(1, variable, 1.0);
            out.row(window.states[1].vars[variable]);
        }
    }
}
