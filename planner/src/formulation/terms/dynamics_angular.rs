//! Angular centroidal dynamics (Eq. 2.4), in body axes:
//! Rᵀ Σ (e − x) × f − (I (w⁺ − w⁻)/h + w̄ × I w̄) = 0. Three rows a sample, N·m.
//!
//! w⁻ = log(R₋ᵀR)/h and w⁺ = log(RᵀR₊)/h are the body's angular velocities on the intervals before and after the
//! sample, w̄ is their mean. A rotation leaves its own axis unchanged, so each has the same components in the body
//! axes at either end of its interval: their difference is the angular acceleration in body axes, and the rows are
//! the thesis's, rotated by Rᵀ.

use crate::families::Family;
use crate::formulation::rows::{Role, RowWriter, Window};
use crate::formulation::{Span, Term, TermInfo};
use crate::problem::state::State;
use nalgebra::{Matrix3, Vector3};
use rollwalk_multibody::euler::BASE_YAW;
use rollwalk_multibody::rotation;

/// See the module.
pub struct DynamicsAngular;

/// Rotation vector from one sample to the next, in body axes, with its derivatives with respect to yaw, pitch and
/// roll of both.
pub(super) fn body_turn(from: &State, to: &State) -> (Vector3<f64>, [Matrix3<f64>; 2]) {
    let phi = rotation::log(&(from.pose.world_from_body.transpose() * to.pose.world_from_body));
    let right = rotation::right_jacobian_inverse(&phi);
    let in_body =
        |s: &State| s.pose.world_from_body.transpose() * Matrix3::from_columns(&s.pose.base_axes);
    (phi, [-right.transpose() * in_body(from), right * in_body(to)])
}

impl Term for DynamicsAngular {
    fn info(&self) -> TermInfo {
        TermInfo { family: Family::AngularDynamics, span: Span::Samples }
    }

    fn write(&self, window: &Window, out: &mut RowWriter) {
        let problem = window.problem;
        let inertia = problem.model.centroidal_inertia_kg_m2();
        let h = problem.interval_s;
        let [before, here, after] = window.states;
        let body_from_world = here.pose.world_from_body.transpose();

        let mut moment = Vector3::zeros();
        let mut force = Vector3::zeros();
        for ee in &problem.layout.end_effectors {
            let f = here.vector(ee.force);
            moment += (here.vector(ee.position) - here.pose.com).cross(&f);
            force += f;
        }
        let (turn_in, d_in) = body_turn(before, here);
        let (turn_out, d_out) = body_turn(here, after);
        let (w_in, w_out) = (turn_in / h, turn_out / h);
        let mean = (w_in + w_out) * 0.5;
        let momentum_rate = inertia * (w_out - w_in) / h + mean.cross(&(inertia * mean));
        let residual = body_from_world * moment - momentum_rate;

        // ∂(w̄ × I w̄)/∂w̄ = [w̄]× I − [I w̄]×, half of it for each interval.
        let gyroscopic =
            (rotation::skew(&mean) * inertia - rotation::skew(&(inertia * mean))) * 0.5;
        let d_w_in = (-inertia / h + gyroscopic) / h;
        let d_w_out = (inertia / h + gyroscopic) / h;
        // ∂(Rᵀ m) = Rᵀ [m]× ∂θ for a turn ∂θ of the body.
        let d_frame =
            body_from_world * rotation::skew(&moment) * Matrix3::from_columns(&here.pose.base_axes);
        let d_attitude = [
            -d_w_in * d_in[0],
            d_frame - d_w_in * d_in[1] - d_w_out * d_out[0],
            -d_w_out * d_out[1],
        ];
        let d_com = body_from_world * rotation::skew(&force);

        out.set(problem.force_scale_n(), Role::Equality);
        for c in 0..3 {
            for (k, d) in d_attitude.iter().enumerate() {
                for angle in 0..3 {
                    out.d(k, BASE_YAW + angle, d[(c, angle)]);
                }
            }
            for (dof, column) in here.pose.d_com.iter().enumerate() {
                out.d(1, dof, (d_com.row(c) * column)[0]);
            }
            for ee in &problem.layout.end_effectors {
                let arm = here.vector(ee.position) - here.pose.com;
                let d_force = body_from_world * rotation::skew(&arm);
                let d_point = -body_from_world * rotation::skew(&here.vector(ee.force));
                out.d_vector(1, ee.force, &d_force.row(c).transpose());
                out.d_vector(1, ee.position, &d_point.row(c).transpose());
            }
            out.row(residual[c]);
        }
    }
}
