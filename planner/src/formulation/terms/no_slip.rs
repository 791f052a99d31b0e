//! Rolling without slip (Eq. 2.8): (e₊ − e)/h + ω a × ρ = 0 on intervals with both ends in stance.
//! Two rows (x, y) per end effector and interval, m/s. For free wheels and blades one end in stance is enough: they
//! lift off and touch down along their rolling direction, at any speed along it.
//!
//! a × ρ = −r t for every tilt, so only the rolling direction matters. It is taken at the middle of the interval: the
//! plans slip by 1.5 mm/s, against 2–19 mm/s with the forward Euler rule printed in the thesis. Skates that touch
//! down or lift off across their rolling direction scrub. With the rows at those intervals their replayed speed rose
//! from 0.66–0.94 of the planned one to 0.96–1.04. Feet and driven wheels walked worse with those rows.

use crate::families::Family;
use crate::formulation::rows::{Role, RowWriter, Subject, Window};
use crate::formulation::{Span, Term, TermInfo};
use crate::problem::state::{d_yaw, rolling_direction};

/// See the module.
pub struct NoSlip;

impl Term for NoSlip {
    fn info(&self) -> TermInfo {
        TermInfo { family: Family::Slip, span: Span::Intervals }
    }

    fn write(&self, window: &Window, out: &mut RowWriter) {
        let problem = window.problem;
        let h = problem.interval_s;
        let [_, here, after] = window.states;
        out.set(1.0, Role::Equality);
        for (j, ee) in problem.layout.end_effectors.iter().enumerate() {
            let free = problem.model.robot().end_effectors[j].contact.drag().is_some();
            match (window.stance(1, j), window.stance(2, j)) {
                (true, true) => {}
                (true, false) | (false, true) if free => {}
                _ => continue,
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
                out.row_of(Subject::EndEffector(j), slip);
            }
        }
    }
}
