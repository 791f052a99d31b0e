//! Clearance between end effectors (Eq. 2.10): |eʲ − eᵏ| ≥ rʲ + rᵏ + β for every pair on different links. One inequality row per
//! pair and sample, m. Points of the body have no rows.
//!
//! The row contains the distance, not its square, so that the residual is a clearance in metres.

use crate::families::{CLEARANCE_M, Family};
use crate::formulation::rows::{Role, RowWriter, Subject, Window};
use crate::formulation::{Span, Term, TermInfo};

/// Constraint: clearance between end effectors.
pub struct Collision;

/// Half-width of the smoothing of Eq. 2.16, m.
const BAND_M: f64 = 0.002;

impl Term for Collision {
    fn info(&self) -> TermInfo {
        TermInfo { family: Family::EndEffectorClearance, span: Span::Samples }
    }

    fn write(&self, window: &Window, out: &mut RowWriter) {
        let problem = window.problem;
        let robot = problem.model.robot();
        let here = window.states[1];
        out.set(1.0, Role::Inequality { band: BAND_M });
        for (j, first) in robot.end_effectors.iter().enumerate() {
            for (k, second) in robot.end_effectors.iter().enumerate().skip(j + 1) {
                // Shapes keep limbs clear of the body.
                if first.link == second.link || second.contact.is_body_point() {
                    continue;
                }
                let (p, q) = (
                    problem.layout.end_effectors[j].position,
                    problem.layout.end_effectors[k].position,
                );
                let between = here.vector(p) - here.vector(q);
                let distance = between.norm();
                // Coinciding points have no direction between them: they are pushed apart along y.
                let direction = between.try_normalize(1e-9).unwrap_or_else(nalgebra::Vector3::y);
                out.d_vector(1, p, &-direction);
                out.d_vector(1, q, &direction);
                let least = first.clearance_radius_m() + second.clearance_radius_m() + CLEARANCE_M;
                out.row_of(Subject::EndEffector(j), least - distance);
            }
        }
    }
}
