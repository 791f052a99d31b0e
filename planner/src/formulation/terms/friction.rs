//! Coulomb friction and unilateral contact (Eq. 2.5) in stance: f_n ≥ f_min and |f_t| ≤ μ f_n. f_n = f·n and f_t = f − f_n n,
//! where n is the normal of the ground. Two inequality rows per end effector and sample, N.
//!
//! The tip of |f_t| is rounded, s = √(|f_t|² + δ²); the error is at most δ, on the safe side. Plans use only a fraction of μ
//! and keep a minimum normal force: see [`crate::problem::Weights`].

use crate::families::Family;
use crate::formulation::rows::{Role, RowWriter, Subject, Window};
use crate::formulation::{Span, Term, TermInfo};

/// Constraint: friction cone of the ground forces.
pub struct Friction;

/// Half-width of the smoothing of Eq. 2.16 for forces, N.
const BAND_N: f64 = 0.02;
/// Rounding δ of the cone's tip, N.
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
            let n = window.states[1].frames[j].normal;
            let f_n = f.dot(&n);
            out.d_upward(1, ee.force, &-n);
            out.d_normal(1, j, &-f);
            let foot = &problem.model.robot().end_effectors[j];
            // The body may rest on some of its points only.
            let least = match foot.contact.is_body_point() {
                true => 0.0,
                false => problem.weights.least_normal_force,
            };
            out.row_of(Subject::EndEffector(j), least * scale - f_n);

            let coefficient = foot.friction_coefficient;
            let mu = coefficient * problem.weights.friction_use;
            let f_t = f - n * f_n;
            let tangential = f_t.x.hypot(f_t.y).hypot(f_t.z).hypot(TIP_N);
            // ∂s/∂f = f_t/s, and ∂s/∂n = −f_n f_t/s.
            let by_force = f_t / tangential;
            out.d_vector(1, ee.force, &(by_force - n * mu));
            out.d_normal(1, j, &-(by_force * f_n + f * mu));
            let slope = -problem.weights.friction_use * f_n;
            out.given("friction_coefficient", coefficient, slope);
            out.row_of(Subject::EndEffector(j), tangential - mu * f_n);
        }
    }
}
