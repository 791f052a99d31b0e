//! Angular centroidal dynamics (Eq. 2.4) in the mean around every sample ([`MeanWeights`]), in the world frame: m − (A⁺ − A⁻)/h²
//! = 0. m is the mean (m₋ + 4m + m₊)/6 of Σ (e − x) × f. Three rows per sample, N·m. The moments are separate variables, defined
//! by three more rows.
//!
//! A⁻ and A⁺ are the moments that the robot sweeps in the intervals before and after the sample ([`SweptMoment`]): A/h is the
//! mean angular momentum of the interval. The thesis uses one body with the inertia of the nominal pose instead, which omits
//! the momentum of the limbs. The omitted moment is 5 mm times the weight in a walk, and 41 mm times the weight in a flying
//! trot.
//!
//! [`MeanWeights`]: crate::problem::MeanWeights
//! [`SweptMoment`]: rollwalk_multibody::euler::SweptMoment

use crate::families::Family;
use crate::formulation::rows::{Role, RowWriter, Window};
use crate::formulation::{Span, Term, TermInfo};
use nalgebra::Vector3;
use rollwalk_multibody::euler::BASE_YAW;

/// Constraint: angular dynamics about the centre of mass.
pub struct DynamicsAngular;

impl Term for DynamicsAngular {
    fn info(&self) -> TermInfo {
        TermInfo { family: Family::AngularDynamics, span: Span::Samples }
    }

    fn write(&self, window: &Window, out: &mut RowWriter) {
        let problem = window.problem;
        let [before, here, _] = window.states;
        let (Some(swept_in), Some(swept_out)) = (&before.swept_to_next, &here.swept_to_next) else {
            unreachable!("a sample in the middle of a window has a next one")
        };
        let means = problem.mean_weights(window.at[1]);
        let per_h2 = means.second_difference / problem.interval_s.powi(2);
        let layout = &problem.layout;
        let mut residual = (swept_in.value - swept_out.value) * per_h2;
        for (state, weight) in window.states.iter().zip(means.linear) {
            residual += state.vector(layout.wrench + 3) * weight;
        }
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

            for (angle, d_in) in swept_in.d_from.iter().enumerate() {
                let dof = BASE_YAW + angle;
                out.d(0, dof, d_in[c] * per_h2);
                out.d(1, dof, (swept_in.d_to[angle] - swept_out.d_from[angle])[c] * per_h2);
                out.d(2, dof, -swept_out.d_to[angle][c] * per_h2);
            }
            for (k, weight) in means.linear.into_iter().enumerate() {
                out.d(k, layout.wrench + 3 + c, weight);
            }
            out.row(residual[c]);
        }
    }
}
