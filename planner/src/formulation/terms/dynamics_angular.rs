//! Angular centroidal dynamics (Eq. 2.4) in the mean around every sample ([`Means`]), in body axes:
//! Rᵀ m − (I (w⁺ − w⁻)/h + w̄ × I w̄) = 0, m the mean (m₋ + 4m + m₊)/6 of Σ (e − x) × f. Three rows a sample, N·m; they
//! read moments that are variables, which three more rows define.
//!
//! w⁻ = log(R₋ᵀR)/h and w⁺ = log(RᵀR₊)/h are the body's angular velocities on the intervals before and after the
//! sample, w̄ is their mean. A rotation leaves its own axis unchanged, so each has the same components in the body
//! axes at either end of its interval: their difference is the angular acceleration in body axes, and the rows are
//! the thesis's, rotated by Rᵀ.
//!
//! [`Means`]: crate::problem::Means

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

        let means = problem.means(window.at[1]);
        let layout = &problem.layout;
        let mut moment = Vector3::zeros();
        for (state, weight) in window.states.iter().zip(means.linear) {
            moment += state.vector(layout.wrench + 3) * weight;
        }
        let (turn_in, d_in) = body_turn(before, here);
        let (turn_out, d_out) = body_turn(here, after);
        let (w_in, w_out) = (turn_in / h, turn_out / h);
        let mean = (w_in + w_out) * 0.5;
        let inertia_h = inertia * means.second_difference / h;
        let momentum_rate = inertia_h * (w_out - w_in) + mean.cross(&(inertia * mean));
        let residual = body_from_world * moment - momentum_rate;

        // ∂(w̄ × I w̄)/∂w̄ = [w̄]× I − [I w̄]×, half of it for each interval.
        let gyroscopic =
            (rotation::skew(&mean) * inertia - rotation::skew(&(inertia * mean))) * 0.5;
        let d_w_in = (-inertia_h + gyroscopic) / h;
        let d_w_out = (inertia_h + gyroscopic) / h;
        // ∂(Rᵀ m) = Rᵀ [m]× ∂θ for a turn ∂θ of the body.
        let d_frame =
            body_from_world * rotation::skew(&moment) * Matrix3::from_columns(&here.pose.base_axes);
        let d_attitude = [
            -d_w_in * d_in[0],
            d_frame - d_w_in * d_in[1] - d_w_out * d_out[0],
            -d_w_out * d_out[1],
        ];
        let [force, sum] = here.wrench(layout);
        out.set(problem.force_scale_n(), Role::Equality);
        for c in 0..3 {
            // Component c of x × y is the triple product of its axis, x and y.
            let axis = Vector3::ith(c, 1.0);
            for ee in &layout.end_effectors {
                let arm = here.vector(ee.position) - here.pose.com;
                out.d_vector(1, ee.force, &axis.cross(&arm));
                out.d_vector(1, ee.position, &here.vector(ee.force).cross(&axis));
            }
            for (dof, column) in here.pose.d_com.iter().enumerate() {
                out.d(1, dof, axis.cross(&force).dot(column));
            }
            out.d(1, layout.wrench + 3 + c, -1.0);
            out.row(sum[c] - here.vars[layout.wrench + 3 + c]);

            for (k, d) in d_attitude.iter().enumerate() {
                for angle in 0..3 {
                    out.d(k, BASE_YAW + angle, d[(c, angle)]);
                }
            }
            for (k, weight) in means.linear.into_iter().enumerate() {
                let d_moment = body_from_world.row(c).transpose() * weight;
                out.d_vector(k, layout.wrench + 3, &d_moment);
            }
            out.row(residual[c]);
        }
    }
}
