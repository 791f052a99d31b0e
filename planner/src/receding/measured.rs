//! A measured state as a planner can start from it: feet that touch are on the ground and do not slip.
//!
//! A measured foot is never at exactly z = 0 and never without slip, and a horizon that began so could not meet its
//! constraints at its first sample. The state that is nearest and does is where it begins.

use nalgebra::{DMatrix, DVector, Matrix3xX, Rotation3, Vector3};
use rollwalk_multibody::euler::JOINTS;
use rollwalk_multibody::{ANGULAR, Frames, LINEAR, RimContact, State, Tree};

/// Rounds of Newton's method to the ground: millimetres become nanometres in two.
const ROUNDS: usize = 3;
/// Regularisation of contacts that a robot cannot move apart, m² or (m/s)².
const DAMPING: f64 = 1e-9;
/// By how much more the velocity of the body counts than that of joints and rims: contacts that slip say more of joints.
const BODY: f64 = 3.0;

/// The nearest state in which the end effectors that stand touch level ground and do not slip, and joints are within their limits.
pub(super) fn on_contacts(tree: &Tree, measured: &State, stands: &[bool]) -> State {
    let mut state = measured.clone();
    for (angle, joint) in state.joint_rad.iter_mut().zip(&tree.robot().joints) {
        *angle = angle.clamp(joint.position_min_rad, joint.position_max_rad);
    }
    for _ in 0..ROUNDS {
        let (rows, off) = contact_rows(tree, &state, stands, Wanted::Height);
        let step = nearest(&rows, &off, &DVector::from_element(tree.dofs(), 1.0));
        let turn = Vector3::from_column_slice(&step.as_slice()[ANGULAR..ANGULAR + 3]);
        state.base_position_m += Vector3::from_column_slice(&step.as_slice()[LINEAR..LINEAR + 3]);
        state.world_from_body = Rotation3::new(turn).matrix() * state.world_from_body;
        for (angle, step) in state.joint_rad.iter_mut().zip(&step.as_slice()[JOINTS..]) {
            *angle += step;
        }
    }
    let (rows, _) = contact_rows(tree, &state, stands, Wanted::Velocity);
    let velocity = DVector::from_column_slice(&state.velocity);
    let mut weights = DVector::from_element(tree.dofs(), 1.0);
    weights.rows_mut(0, JOINTS).fill(BODY);
    for wheel in tree.wheels() {
        let j = wheel.end_effector;
        let dof = tree.wheel_dof(j).expect("it spins");
        weights[dof] = tree.robot().end_effectors[j].radius_m;
    }
    let velocity = &velocity + nearest(&rows, &(&rows * &velocity), &weights);
    state.velocity.copy_from_slice(velocity.as_slice());
    state
}

/// What of a contact is to vanish.
#[derive(Clone, Copy, PartialEq)]
enum Wanted {
    Height,
    Velocity,
}

/// Rows of the contacts that stand, over ν, and their residuals: heights, m, or none for velocities, which are the rows times ν.
fn contact_rows(
    tree: &Tree,
    state: &State,
    stands: &[bool],
    wanted: Wanted,
) -> (DMatrix<f64>, DVector<f64>) {
    let frames = Frames::new(tree, &state.configuration());
    let mut jacobian = Matrix3xX::zeros(tree.dofs());
    let (mut rows, mut off) = (Vec::new(), Vec::new());
    for (j, _) in stands.iter().enumerate().filter(|(_, stands)| **stands) {
        let Some(contact) = RimContact::new(tree, &frames, j, &Vector3::z()) else { continue };
        contact.material_jacobian(tree, &frames, &mut jacobian);
        let glides = tree.robot().end_effectors[j].contact.blade_length_m().is_some();
        let side = Vector3::z().cross(&contact.axis.cross(&Vector3::z())).normalize();
        let directions: &[Vector3<f64>] = match wanted {
            Wanted::Height => &[Vector3::z()],
            Wanted::Velocity if glides => &[side, Vector3::z()],
            Wanted::Velocity => &[Vector3::x(), Vector3::y(), Vector3::z()],
        };
        for direction in directions {
            rows.push(jacobian.tr_mul(direction).transpose());
            off.push(contact.position().z);
        }
    }
    let matrix = match rows.is_empty() {
        true => DMatrix::zeros(0, tree.dofs()),
        false => DMatrix::from_rows(&rows),
    };
    (matrix, DVector::from_vec(off))
}

/// The least change in these weights that takes `rows` · change to −`off`.
fn nearest(rows: &DMatrix<f64>, off: &DVector<f64>, weights: &DVector<f64>) -> DVector<f64> {
    let mut scaled = rows.transpose();
    for (mut row, weight) in scaled.row_iter_mut().zip(weights) {
        row /= weight * weight;
    }
    let count = rows.nrows();
    let gram = rows * &scaled + DMatrix::identity(count, count) * DAMPING;
    let shares = gram.cholesky().expect("damped").solve(off);
    -(scaled * shares)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_robots::{self, uniform};
    use crate::torque;
    use rollwalk_multibody::Kinematics;

    #[test]
    fn what_stands_is_on_the_ground_without_slip_and_little_else_changes() {
        for robot in test_robots::all() {
            let tree = torque::tree(&robot);
            let mut random = uniform(3);
            let mut state = State::nominal(&tree);
            let model = rollwalk_multibody::euler::Model::new(&robot);
            state.base_position_m.z = model.nominal_q()[2] + 0.003;
            state.joint_rad.iter_mut().for_each(|angle| *angle += 0.01 * random());
            state.velocity.iter_mut().for_each(|speed| *speed = 0.05 * random());
            let mut stands = vec![true; robot.end_effectors.len()];
            stands[1] = false;
            let found = on_contacts(&tree, &state, &stands);
            let mut kinematics = Kinematics::new(&tree, &found.configuration());
            kinematics.update(&tree, &found.configuration(), &found.velocity);
            for (j, _) in stands.iter().enumerate().filter(|(_, stands)| **stands) {
                let contact = RimContact::new(&tree, &kinematics.frames, j, &Vector3::z()).unwrap();
                // What the damping leaves where legs share a link.
                let (name, height) = (&robot.name, contact.position().z);
                assert!(height.abs() < 1e-5, "{name}: {height}");
                let velocity = contact.motion(&kinematics).material_velocity;
                assert!(velocity.z.abs() < 1e-4, "{name}: {velocity:?}");
                if robot.end_effectors[j].contact.blade_length_m().is_none() {
                    assert!(velocity.norm() < 1e-4, "{name}: {velocity:?}");
                }
            }
            assert!((found.base_position_m - state.base_position_m).norm() < 0.02);
        }
    }
}
