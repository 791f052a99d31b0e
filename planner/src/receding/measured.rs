//! Projection of a measured state to a feasible start: feet in contact are on the ground and do not slip.
//!
//! A measured foot is never exactly on the ground and never without slip. A horizon from such a state could not meet the
//! constraints of its first sample. It begins instead in the nearest state that meets them.

use super::start::InitialState;
use crate::formulation::terms::motor_speed_rad_s;
use crate::motion::Footing;
use crate::plan::Placement;
use crate::problem::Problem;
use crate::problem::state::State as Sampled;
use crate::problem::variables::Layout;
use crate::start::guess;
use nalgebra::{
    DMatrix, DVector, Isometry3, Matrix3, Matrix3xX, Rotation3, Translation3, UnitQuaternion,
    Vector3,
};
use rollwalk_multibody::euler::{BASE_POSITION, BASE_YAW, JOINTS};
use rollwalk_multibody::{ANGULAR, Frames, LINEAR, RimContact, State, Tree, rotation};

/// Number of Newton steps to the ground. Two steps reduce millimetres to nanometres.
const ROUNDS: usize = 3;
/// Regularisation of contacts that the robot cannot move independently, m² or (m/s)².
const DAMPING: f64 = 1e-9;
/// Weight of the body's velocity relative to that of joints and rims, so that slip is attributed to the joints.
const BODY: f64 = 3.0;

/// Returns the nearest state in which stance feet touch the ground without slip. Joints are clamped to their limits before.
pub(super) fn on_contacts(
    tree: &Tree,
    ground: &Footing,
    measured: &State,
    stands: &[bool],
) -> State {
    let mut state = measured.clone();
    for (angle, joint) in state.joint_rad.iter_mut().zip(&tree.robot().joints) {
        *angle = angle.clamp(joint.position_min_rad, joint.position_max_rad);
    }
    for _ in 0..ROUNDS {
        let (rows, off) = contact_rows(tree, ground, &state, stands, ContactResidual::Distance);
        let step = nearest(&rows, &off, &DVector::from_element(tree.dofs(), 1.0));
        let turn = Vector3::from_column_slice(&step.as_slice()[ANGULAR..ANGULAR + 3]);
        state.base_position_m += Vector3::from_column_slice(&step.as_slice()[LINEAR..LINEAR + 3]);
        state.world_from_body = Rotation3::new(turn).matrix() * state.world_from_body;
        for (angle, step) in state.joint_rad.iter_mut().zip(&step.as_slice()[JOINTS..]) {
            *angle += step;
        }
    }
    let (rows, _) = contact_rows(tree, ground, &state, stands, ContactResidual::Velocity);
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

/// Quantity of a contact that must be zero.
#[derive(Clone, Copy, PartialEq)]
enum ContactResidual {
    Distance,
    Velocity,
}

/// Returns the rows of the stance contacts over the generalised velocity ν, and the distances of the contacts from the ground,
/// m. For [`ContactResidual::Velocity`], the residuals are the product of rows and ν instead.
fn contact_rows(
    tree: &Tree,
    ground: &Footing,
    state: &State,
    stands: &[bool],
    wanted: ContactResidual,
) -> (DMatrix<f64>, DVector<f64>) {
    let frames = Frames::new(tree, &state.configuration());
    let mut jacobian = Matrix3xX::zeros(tree.dofs());
    let (mut rows, mut off) = (Vec::new(), Vec::new());
    for (j, _) in stands.iter().enumerate().filter(|(_, stands)| **stands) {
        let end = &tree.robot().end_effectors[j];
        let map = ground.contact(j, true, &frames.point(end.link, &end.center_in_link_m));
        let Some(contact) = RimContact::on(tree, &frames, j, &map) else { continue };
        let (position, normal) = (contact.position(), *contact.normal());
        let (distance_m, _) = map.distance(&position);
        contact.material_jacobian(tree, &frames, &mut jacobian);
        let glides = end.contact.blade_length_m().is_some();
        let side = normal.cross(&contact.axis.cross(&normal)).normalize();
        let directions: &[Vector3<f64>] = match wanted {
            ContactResidual::Distance => &[normal],
            ContactResidual::Velocity if glides => &[side, normal],
            ContactResidual::Velocity => &[Vector3::x(), Vector3::y(), Vector3::z()],
        };
        for direction in directions {
            rows.push(jacobian.tr_mul(direction).transpose());
            off.push(distance_m);
        }
    }
    let matrix = match rows.is_empty() {
        true => DMatrix::zeros(0, tree.dofs()),
        false => DMatrix::from_rows(&rows),
    };
    (matrix, DVector::from_vec(off))
}

/// Smallest weighted `change` with `rows · change = −off`.
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

/// Position of the body over the ground, and heading of the body.
pub(super) fn over_ground(state: &State) -> Placement {
    let p = state.base_position_m;
    Placement { offset_m: [p.x, p.y], yaw_rad: yaw_pitch_roll(&state.world_from_body).x }
}

/// Velocity of the body along its heading and to the left, m/s, and its yaw rate, rad/s.
pub(super) fn heading_velocity(state: &State) -> [f64; 3] {
    let (sin, cos) = over_ground(state).yaw_rad.sin_cos();
    let [x, y] = [state.velocity[LINEAR], state.velocity[LINEAR + 1]];
    [cos * x + sin * y, cos * y - sin * x, state.velocity[ANGULAR + 2]]
}

pub(super) fn isometry(place: &Placement) -> Isometry3<f64> {
    let [x, y] = place.offset_m;
    let turn = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), place.yaw_rad);
    Isometry3::from_parts(Translation3::new(x, y, 0.0), turn)
}

/// Intrinsic z-y-x angles of a rotation, rad.
fn yaw_pitch_roll(world_from_body: &Matrix3<f64>) -> Vector3<f64> {
    let r = world_from_body;
    let pitch = (-r[(2, 0)]).clamp(-1.0, 1.0).asin();
    Vector3::new(r[(1, 0)].atan2(r[(0, 0)]), pitch, r[(2, 1)].atan2(r[(2, 2)]))
}

/// Converts a state in the frame of the plan to the first sample of a horizon and the sample before it.
pub(super) fn beginning(problem: &Problem, tree: &Tree, state: State) -> InitialState {
    let layout: &Layout = &problem.layout;
    let mut at = DVector::zeros(layout.len);
    at.rows_mut(BASE_POSITION, 3).copy_from(&state.base_position_m);
    let ypr = yaw_pitch_roll(&state.world_from_body);
    at.rows_mut(BASE_YAW, 3).copy_from(&ypr);
    at.rows_mut(JOINTS, state.joint_rad.len()).copy_from_slice(&state.joint_rad);
    let axes = Matrix3::from_columns(&rotation::yaw_pitch_roll_axes(&ypr));
    let spin = Vector3::from_column_slice(&state.velocity[ANGULAR..ANGULAR + 3]);
    // At a pitch of a right angle, Euler rates do not exist, but the robot has fallen.
    let rates = axes.lu().solve(&spin).unwrap_or_default();
    let mut before = at.clone();
    let h = problem.interval_s;
    for k in 0..3 {
        before[BASE_POSITION + k] -= h * state.velocity[LINEAR + k];
        before[BASE_YAW + k] -= h * rates[k];
    }
    for (j, speed) in state.velocity[JOINTS..].iter().take(state.joint_rad.len()).enumerate() {
        before[JOINTS + j] -= h * speed;
    }
    for vars in [&mut at, &mut before] {
        guess::follow_contacts(problem, 1, vars);
    }
    let evaluated = |vars: &DVector<f64>| {
        Sampled::new(&problem.model, layout, &problem.contacts[1], vars.clone())
    };
    let [from, to] = [evaluated(&before), evaluated(&at)];
    for (j, wheel) in layout.end_effectors.iter().enumerate() {
        let (Some(wheel), Some(dof)) = (wheel.wheel, tree.wheel_dof(j)) else { continue };
        // Relative to the ground, the wheel rotates with its motor and with its link.
        before[wheel.speed] = state.velocity[dof] - motor_speed_rad_s(problem, j, &from, &to);
        at[wheel.speed] = before[wheel.speed];
    }
    InitialState { at, before }
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
            let (_, off) = contact_rows(
                &tree,
                &Footing::default(),
                &state,
                &stands,
                ContactResidual::Distance,
            );
            let found = on_contacts(&tree, &Footing::default(), &state, &stands);
            let mut kinematics = Kinematics::new(&tree, &found.configuration());
            kinematics.update(&tree, &found.configuration(), &found.velocity);
            for (j, _) in stands.iter().enumerate().filter(|(_, stands)| **stands) {
                let contact = RimContact::new(&tree, &kinematics.frames, j, &Vector3::z()).unwrap();
                // Remaining error, due to damping, of legs that share a link.
                let (name, height) = (&robot.name, contact.position().z);
                assert!(height.abs() < 1e-5, "{name}: {height}");
                let velocity = contact.motion(&kinematics).material_velocity;
                assert!(velocity.z.abs() < 1e-4, "{name}: {velocity:?}");
                if robot.end_effectors[j].contact.blade_length_m().is_none() {
                    assert!(velocity.norm() < 1e-4, "{name}: {velocity:?}");
                }
            }
            let moved_m = (found.base_position_m - state.base_position_m).norm();
            // The nominal pose of the robot with prismatic joints lifts some feet by centimetres.
            let most_m = off.amax().max(0.02);
            assert!(moved_m < most_m, "{}: {moved_m} of {most_m}", robot.name);
        }
    }
}
