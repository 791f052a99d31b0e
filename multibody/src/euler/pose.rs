//! Forward kinematics in the optimiser's coordinates, with derivatives.
//!
//! A point x on a link moves by w_k × (x − o_k) per radian of the degree of freedom k above it, a
//! vector a by w_k × a, where w_k is the axis and o_k the origin of k in world. The base's yaw, pitch
//! and roll are three such axes through the base origin; its position moves everything alike.

use super::{BASE_YAW, JOINTS, Model};
use crate::{Configuration, Frames, rotation};
use nalgebra::{DVector, Matrix3, Vector3};

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
    /// World-from-body rotation.
    pub world_from_body: Matrix3<f64>,
    /// World-from-link rotation of every link.
    pub world_from_link: Vec<Matrix3<f64>>,
    /// Axes in world of the base's yaw, pitch and roll.
    pub base_axes: [Vector3<f64>; 3],
    /// Centre of mass φ_CoM(q), m.
    pub com: Vector3<f64>,
    /// ∂com/∂q, one column for every entry of `q`.
    pub d_com: Vec<Vector3<f64>>,
    /// End effectors in robot order.
    pub end_effectors: Vec<EndEffectorPose>,
    /// Origin of every link frame in world, m.
    pub link_origins: Vec<Vector3<f64>>,
    /// Axis of every joint in world, in joint order.
    pub joint_axes: Vec<Vector3<f64>>,
    /// First moment Σ m x of every link with all that it carries, kg·m in world.
    pub carried_moment: Vec<Vector3<f64>>,
}

impl Model {
    /// Forward kinematics with derivatives at `q`.
    pub fn pose(&self, q: &DVector<f64>) -> Pose {
        let ypr = Vector3::new(q[BASE_YAW], q[BASE_YAW + 1], q[BASE_YAW + 2]);
        let base_axes = rotation::yaw_pitch_roll_axes(&ypr);
        let frames = self.frames(q);
        let base_origin = frames.link_origins[0];
        let com = frames.com(self.tree());
        let joints = &self.robot().joints;

        let mut d_com = Vec::with_capacity(self.dofs());
        d_com.extend([Vector3::x(), Vector3::y(), Vector3::z()]);
        d_com.extend(base_axes.iter().map(|w| w.cross(&(com - base_origin))));
        let columns = joints.iter().enumerate();
        d_com.extend(columns.map(|(j, joint)| frames.com_column(self.tree(), j, joint.child)));

        let end_effectors = self
            .robot()
            .end_effectors
            .iter()
            .enumerate()
            .map(|(index, ee)| {
                let world_from_link = frames.world_from_link[ee.link];
                let center = frames.point(ee.link, &ee.center_in_link_m);
                let axis =
                    world_from_link * self.wheel_axis_in_link(index).unwrap_or_else(Vector3::zeros);
                let mut d_center = vec![Vector3::x(), Vector3::y(), Vector3::z()];
                let mut d_rotation = vec![Vector3::zeros(); 3];
                for w in &base_axes {
                    d_center.push(w.cross(&(center - base_origin)));
                    d_rotation.push(*w);
                }
                for &j in self.tree().joints_to_link(ee.link) {
                    let w = frames.joint_axes[j];
                    d_center.push(w.cross(&(center - frames.link_origins[joints[j].child])));
                    d_rotation.push(w);
                }
                let d_axis = d_rotation.iter().map(|w| w.cross(&axis)).collect();
                EndEffectorPose { center, d_center, axis, d_axis, world_from_link, d_rotation }
            })
            .collect();
        Pose {
            world_from_body: frames.world_from_link[0],
            base_axes,
            com,
            d_com,
            end_effectors,
            link_origins: frames.link_origins,
            joint_axes: frames.joint_axes,
            carried_moment: frames.carried_moments,
            world_from_link: frames.world_from_link,
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
