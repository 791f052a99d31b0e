//! Pose of a robot: links, centre of mass and end effectors in world, with their derivatives.

use crate::Frames;
use nalgebra::{Matrix3, Vector3};

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
