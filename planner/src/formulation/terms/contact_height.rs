//! Height of contact points above the ground (Eq. 2.9), e_z − h(e_x, e_y): 0 in stance, the profile of [`crate::motion::swing`]
//! in swing. One row per end effector and sample, m.
//!
//! On terrain with edges, h is the envelope in swing. Where the profile is above 0, two inequality rows keep the height between
//! the profile and the profile plus a band. The profile alone would not let a swing clear an edge half-way between two samples
//! ([`super::swing_clearance`]). Without the upper bound, plans throw a leg up for balance.
//!
//! Points of the body have no profile. An inequality row keeps them above the ground; at the first and last sample off the
//! ground they touch it, so that they lift off and touch down without speed.

use crate::families::Family;
use crate::formulation::rows::{Role, RowWriter, Subject, Window};
use crate::formulation::{Span, Term, TermInfo};

/// Half-width of the smoothing of Eq. 2.16, m.
const BAND_M: f64 = 0.002;
/// Height by which a swing on terrain may be above its profile, over the height of the swing.
const SWING_BAND: f64 = 1.25;

/// Height by which a swing on terrain may be above its profile, m.
pub(crate) fn swing_band_m(swing_height_m: f64) -> f64 {
    SWING_BAND * swing_height_m
}

/// Constraint: height of contact points above the ground.
pub struct ContactHeight;

impl Term for ContactHeight {
    fn info(&self) -> TermInfo {
        TermInfo { family: Family::ContactHeight, span: Span::Samples }
    }

    fn write(&self, window: &Window, out: &mut RowWriter) {
        let has_edges = window.problem.ground.has_edges();
        for (j, ee) in window.problem.layout.end_effectors.iter().enumerate() {
            let ground = &window.states[1].frames[j].ground;
            let above_m = window.states[1].vars[ee.position + 2] - ground.height_m;
            let height = window.problem.height_m[window.at[1]][j];
            if window.problem.model.robot().end_effectors[j].contact.is_body_point() {
                let touches = (0..3).any(|k| window.stance(k, j));
                out.set(
                    1.0,
                    if touches { Role::Equality } else { Role::Inequality { band: BAND_M } },
                );
                out.d_height(1, ee.position, -1.0, ground);
                out.row_of(Subject::EndEffector(j), -above_m);
                continue;
            }
            // A foot that is on the ground at the first and last sample of its swing lands without speed.
            if !has_edges || window.stance(1, j) || height == 0.0 {
                out.set(1.0, Role::Equality);
                out.d_height(1, ee.position, 1.0, ground);
                out.row_of(Subject::EndEffector(j), above_m - height);
                continue;
            }
            out.set(1.0, Role::Inequality { band: BAND_M });
            let most = height + swing_band_m(window.problem.swing_height_m);
            for (sign, bound) in [(-1.0, height), (1.0, most)] {
                out.d_height(1, ee.position, sign, ground);
                out.row_of(Subject::EndEffector(j), sign * (above_m - bound));
            }
        }
    }
}
