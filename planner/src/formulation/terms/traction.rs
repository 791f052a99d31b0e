//! Traction of free wheels and blades in stance (Eq. 2.6, with drag): f·t + f_n (c_rr s(v) + c_v v) = 0. v = ω r is the rolling
//! velocity and s(v) = tanh(v/v₀) its smooth sign. One row per wheel and sample, N.
//!
//! Without resistance, the best plan of a robot on free wheels would glide forever; with it, the robot must push. Only the part
//! that grows with speed limits the top speed.

use crate::families::{Family, ROLLING_SIGN_WIDTH_M_S};
use crate::formulation::rows::{Role, RowWriter, Subject, Window};
use crate::formulation::{Span, Term, TermInfo};

/// Constraint: traction of free wheels and blades.
pub struct Traction;

impl Term for Traction {
    fn info(&self) -> TermInfo {
        TermInfo { family: Family::FreeWheelTraction, span: Span::Samples }
    }

    fn write(&self, window: &Window, out: &mut RowWriter) {
        let problem = window.problem;
        out.set(problem.force_scale_n(), Role::Equality);
        let here = window.states[1];
        for (j, ee) in problem.model.robot().end_effectors.iter().enumerate() {
            let vars = problem.layout.end_effectors[j];
            let (Some(drag), Some(wheel), true) =
                (ee.contact.drag(), vars.wheel, window.stance(1, j))
            else {
                continue;
            };
            let f = here.vector(vars.force);
            let (t, n) = (here.frames[j].rolling, here.frames[j].normal);
            let f_n = f.dot(&n);
            let rolling_m_s = here.vars[wheel.speed] * ee.radius_m;
            let sign = (rolling_m_s / ROLLING_SIGN_WIDTH_M_S).tanh();
            let d_sign = (1.0 - sign * sign) / ROLLING_SIGN_WIDTH_M_S;
            let per_normal_force =
                drag.rolling_resistance * sign + drag.rolling_drag_s_m * rolling_m_s;
            let d_rolling = drag.rolling_resistance * d_sign + drag.rolling_drag_s_m;
            out.d_vector(1, vars.force, &(t + n * per_normal_force));
            out.d(1, wheel.speed, f_n * d_rolling * ee.radius_m);
            out.d_rolling(1, j, 1.0, &f);
            out.d_normal(1, j, &(f * per_normal_force));
            out.row_of(Subject::EndEffector(j), f.dot(&t) + f_n * per_normal_force);
        }
    }
}
