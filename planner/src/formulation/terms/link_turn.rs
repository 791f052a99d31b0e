//! Rotation of the link that carries an end effector, from one sample to the next.

use crate::formulation::rows::{RowWriter, Window};
use crate::problem::state::State;
use nalgebra::{Matrix3, Vector3};
use rollwalk_multibody::rotation;

/// Rotation vector of the link over an interval, in the world frame, rad.
pub(super) fn link_turn(j: usize, here: &State, after: &State) -> Vector3<f64> {
    let (from, to) = (&here.pose.end_effectors[j], &after.pose.end_effectors[j]);
    rotation::log(&(to.world_from_link * from.world_from_link.transpose()))
}

/// Adds the derivative of `along`·φ to the next row. φ is the link's rotation vector over the interval of a window; `along` is
/// held constant.
pub(super) fn d_link_turn(
    window: &Window,
    j: usize,
    turn: &Vector3<f64>,
    along: &Vector3<f64>,
    out: &mut RowWriter,
) {
    if !out.differentiates() {
        return;
    }
    // φ = log(exp(δ₊) Φ exp(−δ)) for turns δ of the link in world at either end.
    let right: Matrix3<f64> = rotation::right_jacobian_inverse(turn);
    let [_, here, after] = window.states;
    for (k, state, d) in [(1, here, -right.transpose() * along), (2, after, right * along)] {
        let mount = &state.pose.end_effectors[j];
        let columns = window.problem.model.chain(j).dofs.iter().zip(&mount.d_rotation);
        // The first three translate the base.
        for (&dof, rotation_axis) in columns.skip(3) {
            out.d(k, dof, d.dot(rotation_axis));
        }
    }
}
