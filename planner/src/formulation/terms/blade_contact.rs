//! Contact point of a skate in stance, which stays between the ends of the blade. One inequality row per skate and sample, m
//! along the blade.
//!
//! The contact point moves along the blade as its link pitches. Its distance from the blade's middle is R sin θ, where θ is the
//! angle between ρ and the unit vector m to the middle, in the plane of the blade. With the rolling direction t, the row is
//! |R t·m| ≤ R sin(L / 2R). The kink at the middle is harmless, because the row is far from active there.

use crate::families::Family;
use crate::formulation::rows::{Role, RowWriter, Subject, Window};
use crate::formulation::{Span, Term, TermInfo};

/// Constraint: contact point of a skate on its blade.
pub struct BladeContact;

/// Half-width of the smoothing of Eq. 2.16, m.
const BAND_M: f64 = 0.002;

impl Term for BladeContact {
    fn info(&self) -> TermInfo {
        TermInfo { family: Family::BladeContact, span: Span::Samples }
    }

    fn write(&self, window: &Window, out: &mut RowWriter) {
        let problem = window.problem;
        let here = window.states[1];
        out.set(1.0, Role::Inequality { band: BAND_M });
        for (j, ee) in problem.model.robot().end_effectors.iter().enumerate() {
            let (Some(blade), true) = (ee.blade(), window.stance(1, j)) else { continue };
            let mount = &here.pose.end_effectors[j];
            let middle = mount.world_from_link * blade.middle_in_link;
            let rolling = here.frames[j].rolling;
            let along_m = ee.radius_m * rolling.dot(&middle);
            let factor = along_m.signum() * ee.radius_m;
            out.d_rolling(1, j, factor, &middle);
            for (&dof, turn) in problem.model.chain(j).dofs.iter().zip(&mount.d_rotation).skip(3) {
                out.d(1, dof, factor * rolling.dot(&turn.cross(&middle)));
            }
            out.row_of(Subject::EndEffector(j), along_m.abs() - blade.reach_m);
        }
    }
}
