//! Forward kinematics in the optimiser's coordinates, with derivatives.
//!
//! A point x on a link moves by w_k × (x − o_k) per radian of the degree of freedom k above it, a
//! vector a by w_k × a, where w_k is the axis and o_k the origin of k in world. The base's yaw, pitch
//! and roll are three such axes through the base origin; its position moves everything alike.

use super::{BASE_YAW, JOINTS, Model};
use crate::{Configuration, Frames, rotation};
use nalgebra::{DVector, Matrix3, Vector3};
use rollwalk_robot::EndEffector;

/// An end effector's mount in world, with derivatives along its [`super::Chain`].
#[derive(Clone, Debug)]
pub struct EndEffectorPose {
    /// φ_b(l̂, q): wheel centre or centre of the foot sphere, m.
    pub center: Vector3<f64>,
    /// ∂center/∂q, one column per degree of freedom of the chain.
    pub d_center: Vec<Vector3<f64>>,
    /// φ_b(â, q): wheel axis as the robot file gives it; zero for a foot.
    pub axis: Vector3<f64>,
    /// ∂axis/∂q along the chain.
    pub d_axis: Vec<Vector3<f64>>,
    /// World-from-link rotation of the mounting link.
    pub world_from_link: Matrix3<f64>,
    /// Angular velocity of the mounting link per unit rate of each degree of freedom of the chain.
    pub d_rotation: Vec<Vector3<f64>>,
}

/// Forward kinematics at one configuration.
#[derive(Clone, Debug)]
pub struct Pose {
    /// Frames of all links.
    pub frames: Frames,
    /// Axes in world of the base's yaw, pitch and roll.
    pub base_axes: [Vector3<f64>; 3],
    /// Centre of mass φ_CoM(q), m.
    pub com: Vector3<f64>,
    /// ∂com/∂q, one column for every entry of `q`.
    pub d_com: Vec<Vector3<f64>>,
    /// End effectors in robot order.
    pub end_effectors: Vec<EndEffectorPose>,
}

impl Pose {
    /// Computes the derivatives, if they are not known yet.
    pub fn differentiate(&mut self, model: &Model) {
        if !self.d_com.is_empty() {
            return;
        }
        let Self { frames, base_axes, com, d_com, end_effectors } = self;
        let (robot, tree) = (model.robot(), model.tree());
        let base_origin = frames.link_origins[0];
        let translations = [Vector3::x(), Vector3::y(), Vector3::z()];
        d_com.reserve_exact(model.dofs());
        d_com.extend(translations);
        d_com.extend(base_axes.iter().map(|w| w.cross(&(*com - base_origin))));
        let joints = robot.joints.iter().enumerate();
        d_com.extend(joints.map(|(j, joint)| frames.com_column(tree, j, joint.child)));
        for (at, ee) in end_effectors.iter_mut().zip(&robot.end_effectors) {
            at.d_center.extend(translations);
            at.d_rotation.extend([Vector3::zeros(); 3]);
            let turns = base_axes.iter().map(|w| (w, base_origin));
            let joints = tree.joints_to_link(ee.link).iter();
            let origin = |j: usize| frames.link_origins[robot.joints[j].child];
            let joints = joints.map(|&j| (&frames.joint_axes[j], origin(j)));
            for (w, origin) in turns.chain(joints) {
                at.d_center.push(w.cross(&(at.center - origin)));
                at.d_rotation.push(*w);
            }
            at.d_axis.extend(at.d_rotation.iter().map(|w| w.cross(&at.axis)));
        }
    }
}

impl Model {
    /// Forward kinematics with derivatives at `q`.
    pub fn pose(&self, q: &DVector<f64>) -> Pose {
        let mut pose = self.pose_values(q);
        pose.differentiate(self);
        pose
    }

    /// Forward kinematics at `q` without derivatives: their columns are empty until [`Pose::differentiate`].
    pub fn pose_values(&self, q: &DVector<f64>) -> Pose {
        let ypr = Vector3::new(q[BASE_YAW], q[BASE_YAW + 1], q[BASE_YAW + 2]);
        let frames = self.frames(q);
        let mount = |(index, ee): (usize, &EndEffector)| {
            let world_from_link = frames.world_from_link[ee.link];
            let axis_in_link = self.wheel_axis_in_link(index).unwrap_or_else(Vector3::zeros);
            EndEffectorPose {
                center: frames.point(ee.link, &ee.center_in_link_m),
                d_center: Vec::new(),
                axis: world_from_link * axis_in_link,
                d_axis: Vec::new(),
                world_from_link,
                d_rotation: Vec::new(),
            }
        };
        Pose {
            base_axes: rotation::yaw_pitch_roll_axes(&ypr),
            com: frames.com(self.tree()),
            d_com: Vec::new(),
            end_effectors: self.robot().end_effectors.iter().enumerate().map(mount).collect(),
            frames,
        }
    }

    /// Frames of all links at `q`.
    pub fn frames(&self, q: &DVector<f64>) -> Frames {
        let ypr = Vector3::new(q[BASE_YAW], q[BASE_YAW + 1], q[BASE_YAW + 2]);
        let at = Configuration {
            base_position_m: Vector3::new(q[0], q[1], q[2]),
            world_from_body: rotation::from_yaw_pitch_roll(&ypr),
            joint_rad: &q.as_slice()[JOINTS..],
        };
        Frames::new(self.tree(), &at)
    }
}

/// Height of the wheel centre above its lowest point, m: r·sin of the axis's angle to the vertical;
/// a foot (zero axis) is a sphere.
pub(super) fn drop_to_contact(axis: Vector3<f64>, radius_m: f64) -> f64 {
    radius_m * (1.0 - axis.z * axis.z).max(0.0).sqrt()
}
