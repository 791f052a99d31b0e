//! Pose and generalised velocity of a robot, for exchange between planner, simulators and controllers.

use crate::{Configuration, Tree};
use nalgebra::{Isometry3, Matrix3, Vector3};

/// Pose and generalised velocity of a robot.
#[derive(Clone, Debug, PartialEq)]
pub struct State {
    /// Origin of the root link in world axes, m.
    pub base_position_m: Vector3<f64>,
    /// World-from-body rotation.
    pub world_from_body: Matrix3<f64>,
    /// Joint angles in joint order, rad.
    pub joint_rad: Vec<f64>,
    /// Generalised velocity ν, with [`Tree::dofs`] entries.
    pub velocity: Vec<f64>,
}

impl State {
    /// State at rest in the nominal pose, with the root link at the origin.
    pub fn nominal(tree: &Tree) -> Self {
        Self {
            base_position_m: Vector3::zeros(),
            world_from_body: Matrix3::identity(),
            joint_rad: tree.robot().joints.iter().map(|joint| joint.nominal_rad).collect(),
            velocity: vec![0.0; tree.dofs()],
        }
    }

    /// Configuration of this state.
    pub fn configuration(&self) -> Configuration<'_> {
        Configuration {
            base_position_m: self.base_position_m,
            world_from_body: self.world_from_body,
            joint_rad: &self.joint_rad,
        }
    }

    /// Transforms the state to other world axes: rotates and shifts the robot by `there`.
    pub fn moved(mut self, there: &Isometry3<f64>) -> Self {
        let turn = there.rotation.to_rotation_matrix();
        self.base_position_m = turn * self.base_position_m + there.translation.vector;
        self.world_from_body = turn.matrix() * self.world_from_body;
        turn_base(&mut self.velocity, turn.matrix());
        self
    }
}

/// Rotates the six base entries of a generalised velocity or acceleration.
pub fn turn_base(generalised: &mut [f64], turn: &Matrix3<f64>) {
    for part in generalised[..crate::JOINTS].chunks_exact_mut(3) {
        let turned = turn * Vector3::from_column_slice(part);
        part.copy_from_slice(turned.as_slice());
    }
}
