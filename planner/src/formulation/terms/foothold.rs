//! Footholds inside their patch: n·e ≤ d at each border of the patch on which the end effector stands. One inequality row per
//! border and sample, m. Ground without edges has no rows.

use crate::families::Family;
use crate::formulation::rows::{Role, RowWriter, Subject, Window};
use crate::formulation::{Span, Term, TermInfo};

/// Constraint: footholds at a distance from edges and walls.
pub struct Foothold;

/// Half-width of the smoothing of Eq. 2.16, m.
const BAND_M: f64 = 0.002;

impl Term for Foothold {
    fn info(&self) -> TermInfo {
        TermInfo { family: Family::Foothold, span: Span::Samples }
    }

    fn write(&self, window: &Window, out: &mut RowWriter) {
        out.set(1.0, Role::Inequality { band: BAND_M });
        let contacts = &window.problem.contacts[window.at[1]];
        for (j, (ee, contact)) in
            window.problem.layout.end_effectors.iter().zip(contacts).enumerate()
        {
            let place = window.states[1].vector(ee.position).xy();
            for border in &contact.borders {
                out.d(1, ee.position, border.outward.x);
                out.d(1, ee.position + 1, border.outward.y);
                out.row_of(Subject::EndEffector(j), border.outward.dot(&place) - border.at_m);
            }
        }
    }
}
