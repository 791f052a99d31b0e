//! What is planned for a moment.

use nalgebra::Vector3;
use rollwalk_multibody::State;

/// What is planned for a moment, in the same world frame as the measured state.
#[derive(Clone, Debug, PartialEq)]
pub struct Reference {
    /// Pose and velocity.
    pub state: State,
    /// ν̇.
    pub acceleration: Vec<f64>,
    /// Whether each end effector stands on the ground.
    pub stands: Vec<bool>,
    /// Force of the ground on each end effector, N.
    pub force_n: Vec<Vector3<f64>>,
}
