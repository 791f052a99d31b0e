//! Reference: planned state at a time.

use nalgebra::{Isometry3, Vector3};
use rollwalk_multibody::State;

/// Planned state at a time, in the world frame of the measured state.
#[derive(Clone, Debug, PartialEq)]
pub struct Reference {
    /// Time of the plan, s. Times of a periodic plan continue over all periods.
    pub time_s: f64,
    /// Transform from the ground, whose plane is z = 0, to the world.
    pub world_from_ground: Isometry3<f64>,
    /// Planned pose and velocity.
    pub state: State,
    /// Generalised acceleration ν̇.
    pub acceleration: Vec<f64>,
    /// Stance of each end effector: true if it stands on the ground.
    pub stands: Vec<bool>,
    /// Ground force on each end effector, N.
    pub force_n: Vec<Vector3<f64>>,
    /// Height of the ground at each end effector above the plane z = 0 of the ground, m.
    pub ground_height_m: Vec<f64>,
    /// Unit normal of the ground at each end effector, in the axes of that plane.
    pub ground_normal: Vec<Vector3<f64>>,
}
