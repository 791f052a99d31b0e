//! Traction of free wheels (Eq. 2.6, with rolling resistance): f·t + c_rr f_n s(ω r) = 0 in stance,
//! s(v) = tanh(v/v₀) the smooth sign of the rolling velocity. One row a wheel and sample, N.
//!
//! Without resistance the best plan of a robot on free wheels is to glide for ever; with it the robot
//! has to push.

use super::level;
use crate::formulation::{About, Span, Term};
use crate::rows::{Role, RowWriter, Window};
use crate::state::d_yaw;
use rollwalk_robot::Contact;

/// See the module.
pub struct Traction;

/// Rolling velocity v₀ at which the resistance has nearly reached its full value, m/s.
const SIGN_WIDTH_M_S: f64 = 0.05;

impl Term for Traction {
    fn about(&self) -> About {
        About { name: "free-wheel traction", span: Span::Samples }
    }

    fn write(&self, window: &Window, out: &mut RowWriter) {
        let problem = window.problem;
        out.set(problem.force_scale_n(), level::FORCE_N, Role::Equality);
        let here = window.states[1];
        for (j, ee) in problem.model.robot().end_effectors.iter().enumerate() {
            let vars = problem.layout.end_effectors[j];
            let (Contact::PassiveWheel { rolling_resistance, .. }, Some(wheel), true) =
                (&ee.contact, vars.wheel, window.stance(1, j))
            else {
                continue;
            };
            let f = here.vector(vars.force);
            let t = here.frames[j].rolling;
            let sign = (here.vars[wheel.speed] * ee.radius_m / SIGN_WIDTH_M_S).tanh();
            let d_sign = (1.0 - sign * sign) * ee.radius_m / SIGN_WIDTH_M_S;
            out.d(1, vars.force, t.x);
            out.d(1, vars.force + 1, t.y);
            out.d(1, vars.force + 2, rolling_resistance * sign);
            out.d(1, wheel.speed, rolling_resistance * f.z * d_sign);
            out.d(1, wheel.yaw, f.dot(&d_yaw(&t)));
            out.row(f.dot(&t) + rolling_resistance * f.z * sign);
        }
    }
}
