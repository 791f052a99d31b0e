//! Robot in the coordinates of the trajectory optimiser: `q` = base position (m), base yaw, pitch, roll (rad, R = R_z·R_y·R_x),
//! joint angles (rad).
//!
//! The split follows Pinocchio: an immutable [`Model`], built once per robot, and a [`Pose`] with exact first derivatives for
//! each `q`. A pose contains the [`crate::Frames`] of its links. This module adds the rotation of the base by three angles
//! instead of an angular velocity.

mod forward;
mod model;
mod pose;
mod swept;

pub use model::{Chain, Model, Subtree};
pub use pose::{EndEffectorPose, Pose};
pub use swept::{CarriedPair, SweptMoment, cross_sum, turned_first, turned_second};

pub use crate::JOINTS;

/// Index of the first base position coordinate in `q`: x, y, z in metres.
pub const BASE_POSITION: usize = 0;
/// Index of the base yaw in `q`; pitch and roll follow. Radians, R = R_z·R_y·R_x.
pub const BASE_YAW: usize = 3;
