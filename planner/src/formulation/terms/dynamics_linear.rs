//! Linear centroidal dynamics (Eq. 2.3) in the mean around every sample ([`MeanWeights`]): Σ f + M g − M ẍ = 0. Here f is the
//! mean (f₋ + 4f + f₊)/6, and ẍ the second difference of the centre of mass. Three rows per sample, N, in the world frame. The
//! sums of forces are separate variables, defined by three more rows.
//!
//! [`MeanWeights`]: crate::problem::MeanWeights

use crate::families::Family;
use crate::formulation::rows::{Role, RowWriter, Window};
use crate::formulation::{Span, Term, TermInfo};
use nalgebra::Vector3;
use rollwalk_robot::GRAVITY_M_S2;

/// Constraint: linear dynamics of the centre of mass.
pub struct DynamicsLinear;

impl Term for DynamicsLinear {
    fn info(&self) -> TermInfo {
        TermInfo { family: Family::LinearDynamics, span: Span::Samples }
    }

    fn write(&self, window: &Window, out: &mut RowWriter) {
        let problem = window.problem;
        let mass = problem.model.total_mass_kg();
        let means = problem.mean_weights(window.at[1]);
        let m_h2 = mass * means.second_difference / problem.interval_s.powi(2);
        let [before, here, after] = window.states;
        let layout = &problem.layout;
        let mut residual = Vector3::new(0.0, 0.0, -mass * GRAVITY_M_S2)
            - (before.pose.com - here.pose.com * 2.0 + after.pose.com) * m_h2;
        for (state, weight) in window.states.iter().zip(means.linear) {
            residual += state.vector(layout.wrench) * weight;
        }
        let [sum, _] = here.wrench(layout);
        out.set(problem.force_scale_n(), Role::Equality);
        for c in 0..3 {
            for ee in &layout.end_effectors {
                out.d(1, ee.force + c, 1.0);
            }
            out.d(1, layout.wrench + c, -1.0);
            out.row(sum[c] - here.vars[layout.wrench + c]);

            for (k, weight) in [(0, -m_h2), (1, 2.0 * m_h2), (2, -m_h2)] {
                for (dof, column) in window.states[k].pose.d_com.iter().enumerate() {
                    // A coordinate of the base position moves the COM only along itself.
                    if dof >= 3 || dof == c {
                        out.d(k, dof, weight * column[c]);
                    }
                }
            }
            for (k, weight) in means.linear.into_iter().enumerate() {
                out.d(k, layout.wrench + c, weight);
            }
            out.row(residual[c]);
        }
    }
}
