//! Pose of a robot: links, centre of mass and end effectors in world axes, with derivatives.

use crate::Frames;
use nalgebra::{Matrix3, Vector3};

/// Mounting of an end effector in world axes, with derivatives along its [`super::Chain`].
#[derive(Clone, Debug, Default)]
pub struct EndEffectorPose {
    /// Centre of the wheel or foot sphere φ_b(l̂, q), m.
    pub center: Vector3<f64>,
    /// Derivative ∂center/∂q, one column for each degree of freedom of the chain.
    pub d_center: Vec<Vector3<f64>>,
    /// Wheel axis φ_b(â, q), with the sign of the robot file; zero for a foot.
    pub axis: Vector3<f64>,
    /// Derivative ∂axis/∂q, one column for each degree of freedom of the chain.
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
    /// Axes of the base's yaw, pitch and roll in world axes.
    pub base_axes: [Vector3<f64>; 3],
    /// Centre of mass φ_CoM(q), m.
    pub com: Vector3<f64>,
    /// Derivative ∂com/∂q, one column for each entry of `q`.
    pub d_com: Vec<Vector3<f64>>,
    /// End effectors in the order of the robot.
    pub end_effectors: Vec<EndEffectorPose>,
}
