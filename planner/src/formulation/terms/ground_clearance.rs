//! Clearance to the ground of every capsule end and box corner, and of the joint origins of links without shapes. On terrain with
//! edges, points along the capsules are added. Shapes keep the margin of the robot file, or their nominal height if that is
//! smaller. Joint origins and links with an end effector have no margin. One inequality row per point and sample, m. Distances
//! are of first order, (z − h)/|∇(z − h)|.
//!
//! Every point has a row, not only the lowest one of a link. A row of the lowest point would have a kink where that point
//! changes. As in [`super::link_clearance`], rows are constant at large distances.

use super::link_clearance::{BAND_M, FAR_M};
use crate::families::Family;
use crate::formulation::rows::{Role, RowWriter, Subject, Window};
use crate::formulation::{Span, Term, TermInfo};
use nalgebra::Vector3;
use rollwalk_multibody::euler::{BASE_POSITION, BASE_YAW, JOINTS};

/// Constraint: clearance of links to the ground.
pub struct GroundClearance;

impl Term for GroundClearance {
    fn info(&self) -> TermInfo {
        TermInfo { family: Family::GroundClearance, span: Span::Samples }
    }

    fn write(&self, window: &Window, out: &mut RowWriter) {
        let (model, ground) = (&window.problem.model, &window.problem.ground);
        let (robot, pose) = (model.robot(), &window.states[1].pose);
        out.set(1.0, Role::Inequality { band: BAND_M });
        for point in &window.problem.clearance_points {
            if out.skips_row() {
                continue;
            }
            let center = point.center(&pose.frames);
            let (distance_m, away) = ground.distance(&center);
            let missing = point.least_m + point.radius_m - distance_m;
            let joints = model.tree().joints_to_link(point.link);
            let near = missing > -FAR_M;
            if out.differentiates() {
                let away = if near { away } else { Vector3::zeros() };
                let turn = |axis: &Vector3<f64>, origin: &Vector3<f64>| {
                    -away.dot(&axis.cross(&(center - origin)))
                };
                out.d_upward(1, BASE_POSITION, &-away);
                // Yaw changes no height above level ground.
                let turns = if ground.is_level() { 1 } else { 0 };
                for (c, axis) in pose.base_axes.iter().enumerate().skip(turns) {
                    out.d(1, BASE_YAW + c, turn(axis, &pose.frames.link_origins[0]));
                }
                for &j in joints {
                    let arm = center - pose.frames.link_origins[robot.joints[j].child];
                    out.d(1, JOINTS + j, -away.dot(&pose.frames.joint_displacement(j, &arm)));
                }
            }
            if point.least_m > 0.0 && point.least_m == robot.clearance_margin_m {
                out.given("clearance_margin_m", point.least_m, 1.0);
            }
            out.row_of(Subject::Link(point.link), missing.max(-FAR_M));
        }
    }
}
