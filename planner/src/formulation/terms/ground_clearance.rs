//! Clearance to the ground: every capsule end, box corner and, of links without shapes, joint origin is above the plane
//! z = 0, by the margin of the robot file unless its link carries an end effector. One inequality row per point and
//! sample, m.
//!
//! Points and not the lowest one of a link, so that no row has a kink where the lowest changes. As in
//! [`super::link_clearance`] rows end where there is room.

use super::link_clearance::{BAND_M, FAR_M};
use crate::families::Family;
use crate::formulation::rows::{Role, RowWriter, Subject, Window};
use crate::formulation::{Span, Term, TermInfo};
use nalgebra::Vector3;
use rollwalk_multibody::euler::{BASE_POSITION, BASE_YAW, JOINTS};

/// See the module.
pub struct GroundClearance;

impl Term for GroundClearance {
    fn info(&self) -> TermInfo {
        TermInfo { family: Family::GroundClearance, span: Span::Samples }
    }

    fn write(&self, window: &Window, out: &mut RowWriter) {
        let model = &window.problem.model;
        let (robot, pose) = (model.robot(), &window.states[1].pose);
        out.set(1.0, Role::Inequality { band: BAND_M });
        for point in model.clearance().points() {
            if out.skips_row() {
                continue;
            }
            let center = point.center(&pose.frames);
            let missing = point.least_m + point.radius_m - center.z;
            let joints = model.tree().joints_to_link(point.link);
            let near = missing > -FAR_M;
            if out.differentiates() {
                let mut rises = |variable: usize, by: f64| {
                    out.d(1, variable, if near { -by } else { 0.0 });
                };
                let turn = |axis: &Vector3<f64>, origin: &Vector3<f64>| {
                    let arm = center - origin;
                    axis.x * arm.y - axis.y * arm.x
                };
                rises(BASE_POSITION + 2, 1.0);
                // Yaw changes no height.
                for (c, axis) in pose.base_axes.iter().enumerate().skip(1) {
                    rises(BASE_YAW + c, turn(axis, &pose.frames.link_origins[0]));
                }
                for &j in joints {
                    let origin = &pose.frames.link_origins[robot.joints[j].child];
                    rises(JOINTS + j, turn(&pose.frames.joint_axes[j], origin));
                }
            }
            if point.least_m > 0.0 && point.least_m == robot.clearance_margin_m {
                out.given("clearance_margin_m", point.least_m, 1.0);
            }
            out.row_of(Subject::Link(point.link), missing.max(-FAR_M));
        }
    }
}
