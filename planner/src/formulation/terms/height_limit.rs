//! Height limits of the body or the centre of mass over a span of time (sec. 3.5.2, ducking). One inequality row for
//! each bound and sample, m.

use crate::families::Family;
use crate::formulation::rows::{Role, RowWriter, Window};
use crate::formulation::{Span, Term, TermInfo};
use crate::motion::Subject;
use rollwalk_multibody::euler::BASE_POSITION;

/// See the module.
pub struct HeightBound;

/// Half-width of the smoothing of Eq. 2.16, m.
const BAND_M: f64 = 0.002;

impl Term for HeightBound {
    fn info(&self) -> TermInfo {
        TermInfo { family: Family::HeightLimit, span: Span::Samples }
    }

    fn write(&self, window: &Window, out: &mut RowWriter) {
        out.set(1.0, Role::Inequality { band: BAND_M });
        let state = window.states[1];
        for limit in &window.problem.heights[window.at[1]] {
            for (field, bound, sign) in
                [("below_m", limit.below_m, 1.0), ("above_m", limit.above_m, -1.0)]
            {
                let Some(bound) = bound else { continue };
                let height = match limit.of {
                    Subject::Com => {
                        for (dof, column) in state.pose.d_com.iter().enumerate().skip(2) {
                            out.d(1, dof, sign * column.z);
                        }
                        state.pose.com.z
                    }
                    Subject::Body => {
                        out.d(1, BASE_POSITION + 2, sign);
                        state.vars[BASE_POSITION + 2]
                    }
                    Subject::EndEffector(j) => {
                        let z = window.problem.layout.end_effectors[j].position + 2;
                        out.d(1, z, sign);
                        state.vars[z]
                    }
                };
                out.given(field, bound, -sign);
                out.row_of(limit.of.into(), sign * (height - bound));
            }
        }
    }
}
