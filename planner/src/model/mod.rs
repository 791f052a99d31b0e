//! The robot as the optimiser sees it: forward kinematics, centre of mass, centroidal inertia and
//! their exact first derivatives.
//!
//! Follows Pinocchio's split: an immutable [`Model`] made once per robot, and a [`Pose`] computed
//! from a configuration vector `q`. Used by every term, by the report and by the sampler.

mod kinematics;
pub mod rotation;

pub use kinematics::{EndEffectorPose, Model, Pose};

/// Index of the first base position coordinate in `q`: x, y, z in metres.
pub const BASE_POSITION: usize = 0;
/// Index of the base yaw in `q`; pitch and roll follow. Radians, R = R_z·R_y·R_x.
pub const BASE_YAW: usize = 3;
/// Index of the first joint angle in `q`.
pub const JOINTS: usize = 6;
