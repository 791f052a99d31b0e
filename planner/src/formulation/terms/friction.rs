//! Coulomb friction and unilateral contact (Eq. 2.5), in stance: f_n ≥ f_min, |f_t| ≤ μ f_n.
//! Two inequality rows an end effector and sample, N, in world (flat ground).
//!
//! The tip of |f_t| is rounded, √(f_x² + f_y² + δ²); the error is at most δ, on the safe side.
//! Plans use only a fraction of μ and keep a minimum normal force: see [`crate::problem::Weights`].

use crate::families::Family;
use crate::formulation::rows::{Role, RowWriter, Subject, Window};
use crate::formulation::{Span, Term, TermInfo};

/// See the module.
pub struct Friction;

/// Half-width of the smoothing of Eq. 2.16 for forces, N.
const BAND_N: f64 = 0.02;
/// Rounding of the cone's tip, δ, N.
const TIP_N: f64 = 0.05;

impl Term for Friction {
    fn info(&self) -> TermInfo {
        TermInfo { family: Family::Friction, span: Span::Samples }
    }

    fn write(&self, window: &Window, out: &mut RowWriter) {
        let problem = window.problem;
        let scale = problem.force_scale_n();
        out.set(scale, Role::Inequality { band: BAND_N / scale });
        for (j, ee) in problem.layout.end_effectors.iter().enumerate() {
            if !window.stance(1, j) {
                continue;
            }
            let f = window.states[1].vector(ee.force);
            out.d(1, ee.force + 2, -1.0);
            out.row_of(Subject::EndEffector(j), problem.weights.least_normal_force * scale - f.z);

            let coefficient = problem.model.robot().end_effectors[j].friction_coefficient;
            let mu = coefficient * problem.weights.friction_use;
            let tangential = f.x.hypot(f.y).hypot(TIP_N);
            out.d(1, ee.force, f.x / tangential);
            out.d(1, ee.force + 1, f.y / tangential);
            out.d(1, ee.force + 2, -mu);
            let slope = -problem.weights.friction_use * f.z;
            out.given("friction_coefficient", coefficient, slope);
            out.row_of(Subject::EndEffector(j), tangential - mu * f.z);
        }
    }
}
