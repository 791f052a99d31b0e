//! Rule of the nominal pose: contacts are below the robot's centre of mass.

use super::{Check, Item};
use crate::model::{EndEffector, Robot};
use nalgebra::{Isometry3, Point3, Vector3};

impl Check<'_> {
    /// Refuses feet and wheels above the centre of mass. Requires a robot that breaks no other rule.
    pub(super) fn upright(&mut self) {
        let robot = self.robot;
        let poses = nominal_poses(robot);
        let masses = robot.links.iter().zip(&poses);
        let moment: f64 = masses
            .map(|(link, pose)| (pose * Point3::from(link.com_in_link_m)).z * link.mass_kg)
            .sum();
        let com_z_m = moment / robot.total_mass_kg();
        let feet = robot.end_effectors.iter().enumerate();
        for (index, end) in feet.filter(|(_, end)| !end.contact.is_body_point()) {
            let above_m = lowest_z_m(end, &poses[end.link]) - com_z_m;
            if above_m <= 0.0 {
                continue;
            }
            let joints = robot.joints_above(end.link);
            let angles: Vec<_> = joints
                .iter()
                .map(|&joint| &robot.joints[joint])
                .map(|joint| match joint.travel_m_per_rad {
                    Some(travel) => format!("`{}` at {} m", joint.name, joint.nominal_rad * travel),
                    None => format!("`{}` at {} rad", joint.name, joint.nominal_rad),
                })
                .collect();
            let [x, y, z] = end.center_in_link_m.into();
            let pose = if angles.is_empty() {
                String::new()
            } else {
                format!(", with {}", angles.join(", "))
            };
            self.at(Item::EndEffector(index), format!("end effector `{}`", end.name));
            self.violated(
                "center_in_link_m",
                format_args!(
                    "is [{x}, {y}, {z}]: the contact is {above_m:.3} m above the centre of mass in the nominal pose{pose}"
                ),
                "feet and wheels stand below the body, and z is up: check the sign of z here and in \
                 `origin_in_parent_m`, and the signs of `nominal_rad` from hip to foot",
            );
        }
    }
}

impl Robot {
    /// Joints between the body and a link, beginning at the body.
    fn joints_above(&self, link: usize) -> Vec<usize> {
        let mut link = link;
        let mut joints = Vec::new();
        while let Some(joint) = self.joints.iter().position(|joint| joint.child == link) {
            joints.insert(0, joint);
            link = self.joints[joint].parent;
        }
        joints
    }
}

/// Poses of all links in the body in the nominal pose.
fn nominal_poses(robot: &Robot) -> Vec<Isometry3<f64>> {
    let mut poses = vec![Isometry3::identity(); robot.links.len()];
    for joint in &robot.joints {
        let moved = joint.joint_from_child(joint.nominal_rad);
        poses[joint.child] = poses[joint.parent] * joint.parent_from_joint * moved;
    }
    poses
}

/// Height of the lowest point of a sphere or of a wheel's rim, in the body, m.
fn lowest_z_m(end: &EndEffector, pose: &Isometry3<f64>) -> f64 {
    let center = pose * Point3::from(end.center_in_link_m);
    let axis = end.contact.axis_in_link().map_or_else(Vector3::zeros, |axis| pose.rotation * axis);
    center.z - end.radius_m * (1.0 - axis.z.powi(2)).max(0.0).sqrt()
}
