//! Steering: deviation of the body from the requested velocity. The components are the velocity of the body's origin over the
//! ground, along its heading and to the left, m/s, and the yaw rate, rad/s. Three cost rows per interval of a horizon.
//!
//! The heading is that at the middle of the interval: R_z(−ψ) (p₊ − p)/h with ψ = (yaw + yaw₊)/2.

use crate::families::Family;
use crate::formulation::rows::{Role, RowWriter, Window};
use crate::formulation::{Span, Term, TermInfo};
use rollwalk_multibody::euler::{BASE_POSITION, BASE_YAW};

/// Cost: deviation from the requested velocity.
pub struct Steering;

impl Term for Steering {
    fn info(&self) -> TermInfo {
        TermInfo { family: Family::Steering, span: Span::Intervals }
    }

    fn write(&self, window: &Window, out: &mut RowWriter) {
        let problem = window.problem;
        // The timeline has a sample before the motion.
        let Some([forward_m_s, left_m_s, turn_rad_s]) = problem.steering.get(window.at[1] - 1)
        else {
            return;
        };
        let weight = problem.weights.steering * problem.per_time(0);
        out.set(1.0, Role::Cost { weight });
        let [_, here, after] = window.states.map(|state| &state.vars);
        let h = problem.interval_s;
        let (sin, cos) = (0.5 * (here[BASE_YAW] + after[BASE_YAW])).sin_cos();
        let [vx, vy] = [0, 1].map(|c| (after[BASE_POSITION + c] - here[BASE_POSITION + c]) / h);
        let (forward, left) = (cos * vx + sin * vy, cos * vy - sin * vx);
        for (velocity, wanted, along, by_yaw) in
            [(forward, forward_m_s, [cos, sin], left), (left, left_m_s, [-sin, cos], -forward)]
        {
            for (k, sign) in [(1, -1.0), (2, 1.0)] {
                for (c, share) in along.into_iter().enumerate() {
                    out.d(k, BASE_POSITION + c, sign * share / h);
                }
                out.d(k, BASE_YAW, 0.5 * by_yaw);
            }
            out.row(velocity - wanted);
        }
        out.d(1, BASE_YAW, -1.0 / h);
        out.d(2, BASE_YAW, 1.0 / h);
        out.row((after[BASE_YAW] - here[BASE_YAW]) / h - turn_rad_s);
    }
}
