//! Height of swings half-way between two samples, on terrain with edges: s(p) + 0.4 (w + w₊) − p_z ≤ 0, where s is the envelope
//! of the terrain, w the profile of [`crate::motion::swing`], and p = −⅛ e₋ + ¾ e + ⅜ e₊ the parabola through three samples.
//! Each end effector has one inequality row per interval, m.
//!
//! A spline through samples above an edge can cut the edge between the samples.

use crate::families::Family;
use crate::formulation::rows::{Role, RowWriter, Subject, Window};
use crate::formulation::{Span, Term, TermInfo};
use nalgebra::Vector3;

/// Constraint: swings above the terrain between samples.
pub struct SwingClearance;

/// Half-width of the smoothing of Eq. 2.16, m.
const BAND_M: f64 = 0.002;
/// Weights of the three samples half-way between the second and the third.
const HALF_WAY: [f64; 3] = [-0.125, 0.75, 0.375];
/// Fraction of the mean profile that a swing must keep half-way.
const PROFILE: f64 = 0.8;

impl Term for SwingClearance {
    fn info(&self) -> TermInfo {
        TermInfo { family: Family::SwingClearance, span: Span::Intervals }
    }

    fn write(&self, window: &Window, out: &mut RowWriter) {
        let problem = window.problem;
        if !problem.ground.has_edges() {
            return;
        }
        out.set(1.0, Role::Inequality { band: BAND_M });
        for (j, ee) in problem.layout.end_effectors.iter().enumerate() {
            if window.stance(1, j) && window.stance(2, j) {
                continue;
            }
            let profile = [1, 2].map(|k| problem.height_m[window.at[k]][j]);
            let least_m = PROFILE * 0.5 * (profile[0] + profile[1]);
            // On the ground at both ends of the interval.
            if least_m == 0.0 {
                continue;
            }
            let swings = if window.stance(1, j) { 2 } else { 1 };
            let envelope = &problem.contacts[window.at[swings]][j].map;
            let weighted = |k: usize| window.states[k].vector(ee.position) * HALF_WAY[k];
            let point: Vector3<f64> = (0..3).map(weighted).sum();
            let below = envelope.at(&point);
            for (k, weight) in HALF_WAY.into_iter().enumerate() {
                out.d_height(k, ee.position, -weight, &below);
            }
            out.row_of(Subject::EndEffector(j), below.height_m + least_m - point.z);
        }
    }
}
