//! Rolling without slip (Eq. 2.8): (e₊ − e)/h + ω a × ρ = 0 on intervals with both ends in stance.
//! Two rows (x, y) an end effector and interval, m/s.
//!
//! a × ρ = −r t for every tilt, so only the rolling direction matters. It is taken at the middle of
//! the interval; the thesis prints forward Euler, whose plans slip by 2–19 mm/s where the midpoint's
//! slip by 1.5.

use super::level;
use crate::formulation::{About, Span, Term};
use crate::rows::{Role, RowWriter, Window};
use crate::state::{d_yaw, rolling_direction};

/// See the module.
pub struct NoSlip;

impl Term for NoSlip {
    fn about(&self) -> About {
        About { name: "slip", span: Span::Intervals }
    }

    fn write(&self, window: &Window, out: &mut RowWriter) {
        let problem = window.problem;
        let h = problem.interval_s;
        let [_, here, after] = window.states;
        out.set(1.0, level::SLIP_M_S, Role::Equality);
        for (j, ee) in problem.layout.end_effectors.iter().enumerate() {
            if !window.stance(1, j) || !window.stance(2, j) {
                continue;
            }
            let velocity = (after.vector(ee.position) - here.vector(ee.position)) / h;
            let radius = problem.model.robot().end_effectors[j].radius_m;
            let rolling = ee.wheel.map(|wheel| {
                let yaw = 0.5 * (here.vars[wheel.yaw] + after.vars[wheel.yaw]);
                (wheel, here.vars[wheel.speed] * radius, rolling_direction(yaw))
            });
            for c in 0..2 {
                let mut slip = velocity[c];
                out.d(1, ee.position + c, -1.0 / h);
                out.d(2, ee.position + c, 1.0 / h);
                if let Some((wheel, rim_speed, t)) = rolling {
                    slip -= rim_speed * t[c];
                    out.d(1, wheel.speed, -radius * t[c]);
                    let d_mid_yaw = -0.5 * rim_speed * d_yaw(&t)[c];
                    out.d(1, wheel.yaw, d_mid_yaw);
                    out.d(2, wheel.yaw, d_mid_yaw);
                }
                out.row(slip);
            }
        }
    }
}
