//! Clearance between links: d(a, b) ≥ β for every pair of shapes of limbs and body that no joint connects. β is the margin of the
//! robot file, or the distance in the nominal pose if that is smaller. One inequality row per pair and sample, m.
//!
//! A distance depends only on the joints between the two links. Rows are constant from [`FAR_M`] beyond the margin, where they do
//! not contribute to the energy. Bounding spheres of the shapes identify these distant pairs, which are most, at almost no cost.

use crate::families::Family;
use crate::formulation::rows::{Role, RowWriter, Subject, Window};
use crate::formulation::{Span, Term, TermInfo};
use rollwalk_multibody::euler::JOINTS;

/// Constraint: clearance between links.
pub struct LinkClearance;

/// Half-width of the smoothing of Eq. 2.16, m.
pub(super) const BAND_M: f64 = 0.002;
/// Distance beyond the margin above which a row is constant, m: well beyond the smoothing and the shifts of multipliers.
pub(super) const FAR_M: f64 = 0.01;

impl Term for LinkClearance {
    fn info(&self) -> TermInfo {
        TermInfo { family: Family::LinkClearance, span: Span::Samples }
    }

    fn write(&self, window: &Window, out: &mut RowWriter) {
        let model = &window.problem.model;
        let (robot, clearance, pose) = (model.robot(), model.clearance(), &window.states[1].pose);
        let placed = clearance.placed(&pose.frames);
        out.set(1.0, Role::Inequality { band: BAND_M });
        for pair in clearance.pairs() {
            if out.skips_row() {
                continue;
            }
            let near = placed.distance(pair, pair.least_m + FAR_M);
            if out.differentiates() {
                for (joints, sign) in pair.joints.iter().zip([1.0, -1.0]) {
                    for &j in joints {
                        let by_joint =
                            near.map_or(0.0, |near| near.by_joint(&pose.frames, robot, j));
                        out.d(1, JOINTS + j, sign * by_joint);
                    }
                }
            }
            if pair.least_m == robot.clearance_margin_m {
                out.given("clearance_margin_m", pair.least_m, 1.0);
            }
            let missing = near.map_or(-FAR_M, |near| pair.least_m - near.distance_m);
            out.row_of(Subject::Links(pair.links), missing);
        }
    }
}
