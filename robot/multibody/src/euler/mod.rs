//! The robot in the coordinates of the trajectory optimiser: `q` = base position (m), base yaw, pitch,
//! roll (rad, R = R_z·R_y·R_x), joint angles (rad).
//!
//! Follows Pinocchio's split: an immutable [`Model`] made once per robot, and a [`Pose`] with exact first
//! derivatives computed from `q`. A pose has the [`crate::Frames`] of its links; this module adds the turn of the base by
//! three angles in place of an angular velocity.

mod forward;
mod model;
mod pose;
mod swept;

pub use model::{Carried, Chain, Model};
pub use pose::{EndEffectorPose, Pose};
pub use swept::{CarriedPair, SweptMoment, cross_sum, turned_first, turned_second};

pub use crate::JOINTS;

/// Index of the first base position coordinate in `q`: x, y, z in metres.
pub const BASE_POSITION: usize = 0;
/// Index of the base yaw in `q`; pitch and roll follow. Radians, R = R_z·R_y·R_x.
pub const BASE_YAW: usize = 3;
