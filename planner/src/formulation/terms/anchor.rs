//! Start placement of the motion in the world: x₁, y₁ and yaw₁ of the base. Three rows per motion, m and rad. Without them, any
//! plan could be shifted and turned in the ground plane.

use crate::families::Family;
use crate::formulation::rows::{Role, RowWriter, Window};
use crate::formulation::{Span, Term, TermInfo};
use crate::plan::Placement;
use rollwalk_multibody::euler::{BASE_POSITION, BASE_YAW};

/// Constraint: start placement of the base. It is the origin with heading 0, except for horizons on terrain.
pub struct Anchor;

impl Term for Anchor {
    fn info(&self) -> TermInfo {
        TermInfo { family: Family::Anchor, span: Span::Ends }
    }

    fn write(&self, window: &Window, out: &mut RowWriter) {
        out.set(1.0, Role::Equality);
        let Placement { offset_m: [x_m, y_m], yaw_rad } = window.problem.start;
        for (variable, place) in
            [(BASE_POSITION, x_m), (BASE_POSITION + 1, y_m), (BASE_YAW, yaw_rad)]
        {
            out.d(1, variable, 1.0);
            out.row(window.states[1].vars[variable] - place);
        }
    }
}
