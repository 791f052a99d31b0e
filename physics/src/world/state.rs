//! Pose and velocity of a robot and of its bodies.

use crate::motion::BodyMotion;
use nalgebra::{Matrix3, Vector3};
use rollwalk_multibody::{Configuration, Frames, Tree};
use rollwalk_robot::Robot;

/// Pose and velocity of a robot.
#[derive(Clone, Debug, PartialEq)]
pub struct RobotState {
    /// Position of the root link's origin in world axes, m.
    pub base_position_m: Vector3<f64>,
    /// Rotation from body to world axes.
    pub world_from_body: Matrix3<f64>,
    /// Velocity of the origin of the root link, m/s.
    pub base_velocity_m_s: Vector3<f64>,
    /// Angular velocity of the root link in world axes, rad/s.
    pub base_spin_rad_s: Vector3<f64>,
    /// Angles of the joints, rad.
    pub joint_rad: Vec<f64>,
    /// Speeds of the joints, rad/s.
    pub joint_rad_s: Vec<f64>,
    /// Speed of each end effector's wheel about its axis relative to its link, rad/s; 0 for end effectors that do not spin.
    pub wheel_rad_s: Vec<f64>,
}

impl RobotState {
    /// State at rest in the nominal pose, with the root link's origin at a position.
    pub fn nominal(robot: &Robot, base_position_m: Vector3<f64>) -> Self {
        Self {
            base_position_m,
            world_from_body: Matrix3::identity(),
            base_velocity_m_s: Vector3::zeros(),
            base_spin_rad_s: Vector3::zeros(),
            joint_rad: robot.joints.iter().map(|joint| joint.nominal_rad).collect(),
            joint_rad_s: vec![0.0; robot.joints.len()],
            wheel_rad_s: vec![0.0; robot.end_effectors.len()],
        }
    }
}

/// Motions of the links' bodies. `centers` are their centres of mass in link axes.
pub(super) fn link_motions(
    robot: &Robot,
    state: &RobotState,
    centers: &[Vector3<f64>],
) -> Vec<BodyMotion> {
    let tree = Tree::new(robot);
    let at = Configuration {
        base_position_m: state.base_position_m,
        world_from_body: state.world_from_body,
        joint_rad: &state.joint_rad,
    };
    let frames = Frames::new(&tree, &at);
    // First the motions of the links' origins.
    let mut motions: Vec<BodyMotion> = (0..robot.links.len())
        .map(|link| BodyMotion {
            position: frames.link_origins[link],
            rotation: frames.world_from_link[link],
            velocity: state.base_velocity_m_s,
            spin: state.base_spin_rad_s,
        })
        .collect();
    for (number, joint) in robot.joints.iter().enumerate() {
        let parent = motions[joint.parent];
        let (_, mut velocity) = parent.point(&joint.parent_from_joint.translation.vector);
        if let Some(slide) = &frames.joint_slides[number] {
            let moved = slide * state.joint_rad[number];
            velocity += parent.spin.cross(&moved) + slide * state.joint_rad_s[number];
        }
        let child = &mut motions[joint.child];
        child.velocity = velocity;
        child.spin = parent.spin + frames.joint_axes[number] * state.joint_rad_s[number];
    }
    for (motion, center) in motions.iter_mut().zip(centers) {
        (motion.position, motion.velocity) = motion.point(center);
    }
    motions
}
