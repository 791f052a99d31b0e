//! Reference: the plan at a moment.

use nalgebra::{Isometry3, Vector3};
use rollwalk_multibody::State;

/// Reference at a moment, in the same world frame as the measured state.
#[derive(Clone, Debug, PartialEq)]
pub struct Reference {
    /// Time of the plan, s; of one that repeats, later periods counted on.
    pub time_s: f64,
    /// The ground: its plane z = 0, whose normal is z.
    pub world_from_ground: Isometry3<f64>,
    /// Pose and velocity.
    pub state: State,
    /// ν̇.
    pub acceleration: Vec<f64>,
    /// Stance of each end effector: true if it stands on the ground.
    pub stands: Vec<bool>,
    /// Force of the ground on each end effector, N.
    pub force_n: Vec<Vector3<f64>>,
}
