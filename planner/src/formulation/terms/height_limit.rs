//! Limits on the height of the body or the centre of mass above the ground over a span of time (sec. 3.5.2, ducking). One
//! inequality row for each bound and sample, m.

use crate::families::Family;
use crate::formulation::rows::{Role, RowWriter, Window};
use crate::formulation::{Span, Term, TermInfo};
use crate::motion::Subject;
use rollwalk_multibody::euler::BASE_POSITION;

/// Constraint: height limits of the motion.
pub struct HeightBound;

/// Half-width of the smoothing of Eq. 2.16, m.
const BAND_M: f64 = 0.002;

impl Term for HeightBound {
    fn info(&self) -> TermInfo {
        TermInfo { family: Family::HeightLimit, span: Span::Samples }
    }

    fn write(&self, window: &Window, out: &mut RowWriter) {
        out.set(1.0, Role::Inequality { band: BAND_M });
        let (problem, state) = (window.problem, window.states[1]);
        for limit in &problem.heights[window.at[1]] {
            for (field, bound, sign) in
                [("below_m", limit.below_m, 1.0), ("above_m", limit.above_m, -1.0)]
            {
                let Some(bound) = bound else { continue };
                let point = match limit.of {
                    Subject::Com => state.pose.com,
                    Subject::Body => state.vector(BASE_POSITION),
                    Subject::EndEffector(j) => {
                        state.vector(problem.layout.end_effectors[j].position)
                    }
                };
                let ground = problem.ground.body().at(&point);
                match limit.of {
                    Subject::Com => out.d_com_height(1, sign, &ground),
                    Subject::Body => out.d_height(1, BASE_POSITION, sign, &ground),
                    Subject::EndEffector(j) => {
                        let first = problem.layout.end_effectors[j].position;
                        out.d_height(1, first, sign, &ground);
                    }
                }
                let height = point.z - ground.height_m;
                out.given(field, bound, -sign);
                out.row_of(limit.of.into(), sign * (height - bound));
            }
        }
    }
}
