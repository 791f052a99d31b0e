//! Clearance to obstacles: d(part, obstacle) ≥ margin for every part of the robot and every obstacle in its reach. One
//! inequality row per pair and sample, m. As in [`super::link_clearance`], rows are constant at large distances.

use super::link_clearance::{BAND_M, FAR_M};
use crate::families::Family;
use crate::formulation::rows::{Role, RowWriter, Subject, Window};
use crate::formulation::{Span, Term, TermInfo};
use nalgebra::Vector3;
use rollwalk_multibody::euler::{BASE_POSITION, BASE_YAW, JOINTS};

/// Constraint: clearance of the robot to obstacles.
pub struct ObstacleClearance;

impl Term for ObstacleClearance {
    fn info(&self) -> TermInfo {
        TermInfo { family: Family::ObstacleClearance, span: Span::Samples }
    }

    fn write(&self, window: &Window, out: &mut RowWriter) {
        let (model, obstacles) = (&window.problem.model, &window.problem.obstacles);
        let (robot, pose) = (model.robot(), &window.states[1].pose);
        out.set(1.0, Role::Inequality { band: BAND_M });
        for part in &window.problem.obstacle_parts {
            let placed = part.placed(&pose.frames);
            for obstacle in obstacles {
                if out.skips_row() {
                    continue;
                }
                let near = obstacle.distance(&placed, obstacle.margin_m + FAR_M);
                if out.differentiates() {
                    let by_displacement =
                        near.map_or_else(Vector3::zeros, |near| near.by_displacement());
                    let by_turn = |axis: &Vector3<f64>, origin: &Vector3<f64>| {
                        near.map_or(0.0, |near| -near.by_turn(axis, origin))
                    };
                    out.d_vector(1, BASE_POSITION, &-by_displacement);
                    for (c, axis) in pose.base_axes.iter().enumerate() {
                        out.d(1, BASE_YAW + c, by_turn(axis, &pose.frames.link_origins[0]));
                    }
                    for &j in part.joints(model.tree()) {
                        let by_joint =
                            near.map_or(0.0, |near| -near.by_joint(&pose.frames, robot, j));
                        out.d(1, JOINTS + j, by_joint);
                    }
                }
                let missing = near.map_or(-FAR_M, |near| obstacle.margin_m - near.distance_m);
                out.row_of(Subject::Link(part.link), missing);
            }
        }
    }
}
