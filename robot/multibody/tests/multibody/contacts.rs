//! Tests of contact points at the rim: position, and velocities of the geometric and the material point.

use crate::jacobians::{assert_near, difference, rate};
use crate::robots::{State, body, for_random_states};
use nalgebra::{DVector, Matrix3xX, Rotation3, Unit, UnitQuaternion, Vector3};
use rollwalk_multibody::{Frames, Kinematics, RimContact, Tree};
use rollwalk_robot::{Contact, EndEffector, RollingDrag};

fn contact(tree: &Tree, frames: &Frames, state: &State, ee: usize) -> RimContact {
    RimContact::new(tree, frames, ee, &state.normal).expect("random wheels do not lie flat")
}

#[test]
fn the_contact_is_the_lowest_point_of_the_rim() {
    for_random_states(|tree, state| {
        let frames = Frames::new(tree, &state.configuration());
        for (index, ee) in tree.robot().end_effectors.iter().enumerate() {
            let contact = contact(tree, &frames, state, index);
            let lever = contact.lever;
            assert!((lever.norm() - ee.radius_m).abs() < 1e-14); // rounding
            assert!(lever.dot(&contact.axis).abs() < 1e-14); // rounding
            for turn in 1..12 {
                // Other points: on the rim of a wheel, and on the sphere of a foot.
                let axis = Unit::try_new(contact.axis, 0.5).unwrap_or(Vector3::x_axis());
                let rotation = Rotation3::from_axis_angle(&axis, turn as f64 * 0.5);
                assert!((rotation * lever - lever).dot(&state.normal) > -1e-15, "{}", ee.name);
            }
        }
    });
}

#[test]
fn the_material_point_is_the_tyre_and_its_jacobian_has_the_right_rates() {
    for_random_states(|tree, state| {
        let mut now = Kinematics::new(tree, &state.configuration());
        now.update(tree, &state.configuration(), &state.velocity);
        let nu = DVector::from_column_slice(&state.velocity);
        let nu_dot = DVector::from_column_slice(&state.acceleration);
        for (index, ee) in tree.robot().end_effectors.iter().enumerate() {
            let at = contact(tree, &now.frames, state, index);
            let what = format!("{} {}", tree.robot().name, ee.name);
            let jacobian_of = |state: &State| {
                let frames = Frames::new(tree, &state.configuration());
                let mut out = Matrix3xX::zeros(tree.dofs());
                contact(tree, &frames, state, index).material_jacobian(tree, &frames, &mut out);
                out
            };
            let j = jacobian_of(state);
            // A material point of the tyre: fixed in the link except for the rotation of the wheel, which is not part of
            // `State`.
            let rotation = now.frames.world_from_link[ee.link];
            let lever_in_link = rotation.transpose() * at.lever;
            let mut expected = difference(tree, state, |frames| {
                frames.point(ee.link, &(ee.center_in_link_m + lever_in_link))
            });
            if let Some(dof) = tree.wheel_dof(index) {
                let axis = ee.contact.axis_in_link().unwrap();
                expected.set_column(dof, &(rotation * axis.cross(&lever_in_link)));
            }
            assert_near(&j, &expected, &what);
            let motion = at.motion(&now);
            assert!((&j * &nu - motion.material_velocity).norm() < 1e-12, "{what}"); // rounding

            // Rate of the Jacobian at the lowest point, recomputed at each time: the rolling constraint.
            let mut j_dot = Matrix3xX::zeros(tree.dofs());
            at.material_jacobian_derivative(tree, &now, &motion.geometric_velocity, &mut j_dot);
            assert_near(&j_dot, &rate(state, jacobian_of), &what);
            assert!((&j_dot * &nu - motion.rolling_acceleration).norm() < 1e-11, "{what}"); // rounding

            // Rate of the Jacobian at a material point of the tyre.
            let rubber = |state: &State, time_s: f64| {
                let frames = Frames::new(tree, &state.configuration());
                let speed = tree.wheel_dof(index).map_or(0.0, |dof| state.velocity[dof]);
                let axis = Unit::try_new(at.axis, 0.5).unwrap_or(Vector3::x_axis());
                let axis = Unit::new_unchecked(rotation.transpose() * *axis);
                let lever_in_link =
                    Rotation3::from_axis_angle(&axis, speed * time_s) * lever_in_link;
                let mut moved = contact(tree, &frames, state, index);
                moved.lever = frames.world_from_link[ee.link] * lever_in_link;
                let mut out = Matrix3xX::zeros(tree.dofs());
                moved.material_jacobian(tree, &frames, &mut out);
                out
            };
            let step = 1e-5;
            let expected = (rubber(&state.after(step), step) - rubber(&state.after(-step), -step))
                / (2.0 * step);
            at.material_jacobian_derivative(tree, &now, &motion.material_velocity, &mut j_dot);
            assert_near(&j_dot, &expected, &what);
            assert!((&j_dot * &nu - motion.material_acceleration).norm() < 1e-11, "{what}"); // rounding

            // With acceleration, both accelerations gain J ν̇.
            let mut accelerated = now.clone();
            accelerated.accelerate(tree, &state.acceleration);
            let faster = at.motion(&accelerated);
            for (with, without) in [
                (faster.material_acceleration, motion.material_acceleration),
                (faster.rolling_acceleration, motion.rolling_acceleration),
            ] {
                assert!((with - without - &j * &nu_dot).norm() < 1e-11, "{what}"); // rounding
            }
        }
    });
}

#[test]
fn the_geometric_point_moves_as_its_jacobian_says() {
    for_random_states(|tree, state| {
        let mut now = Kinematics::new(tree, &state.configuration());
        now.update(tree, &state.configuration(), &state.velocity);
        let nu = DVector::from_column_slice(&state.velocity);
        for index in 0..tree.robot().end_effectors.len() {
            let what = format!("{} end effector {index}", tree.robot().name);
            let at = contact(tree, &now.frames, state, index);
            let mut j = Matrix3xX::zeros(tree.dofs());
            at.geometric_jacobian(tree, &now.frames, &mut j);
            let position = |frames: &Frames| contact(tree, frames, state, index).position();
            assert_near(&j, &difference(tree, state, position), &what);
            let motion = at.motion(&now);
            assert!((&j * &nu - motion.geometric_velocity).norm() < 1e-12, "{what}"); // rounding
            let across = motion.geometric_velocity - motion.material_velocity;
            assert!(across.dot(&state.normal).abs() < 1e-12, "{what}"); // rounding
        }
    });
}

/// Body 0.1 m above a wheel of 0.05 m radius with axis +y.
fn unicycle() -> Tree {
    let mut robot = body(2.0, [0.02, 0.03, 0.04]);
    robot.end_effectors.push(EndEffector {
        name: "wheel".into(),
        link: 0,
        center_in_link_m: Vector3::new(0.0, 0.0, -0.1),
        radius_m: 0.05,
        friction_coefficient: 1.0,
        contact: Contact::PassiveWheel {
            axis_in_link: Vector3::y(),
            drag: RollingDrag { rolling_resistance: 0.0, rolling_drag_s_m: 0.0 },
        },
        soft: None,
    });
    Tree::new(&robot).with_spinning_wheels(|_| 1e-3)
}

#[test]
fn an_upright_wheel_rolls_without_slip_at_speed_over_radius() {
    let tree = unicycle();
    let mut state = State::random(&tree, &mut fastrand::Rng::with_seed(1));
    state.world_from_body = UnitQuaternion::identity();
    state.normal = Vector3::z();
    state.velocity = vec![0.3, 0.0, 0.0, 0.0, 0.0, 0.0, 0.3 / 0.05];
    let mut now = Kinematics::new(&tree, &state.configuration());
    now.update(&tree, &state.configuration(), &state.velocity);
    let motion = contact(&tree, &now.frames, &state, 0).motion(&now);
    let near = |found: Vector3<f64>, x: f64, z: f64| {
        assert!((found - Vector3::new(x, 0.0, z)).norm() < 1e-14, "{found}") // rounding
    };
    near(motion.material_velocity, 0.0, 0.0);
    near(motion.geometric_velocity, 0.3, 0.0);
    // On its cycloid, the tyre accelerates upwards by s² r; the rolling constraint does not contain this.
    near(motion.material_acceleration, 0.0, 6.0f64.powi(2) * 0.05);
    near(motion.rolling_acceleration, 0.0, 0.0);
}

#[test]
fn a_coin_rolls_in_a_circle_without_slip() {
    // The wheel leans inwards by θ and its contact runs along a circle of radius R about the world's origin
    // with yaw rate ψ'. At y = R the link moves the contact by −ψ' R, the spin s by −s r, both along x.
    let tree = unicycle();
    let (lean, yaw_rate, circle, r) = (0.4f64, 1.7, 0.6, 0.05);
    let mut state = State::random(&tree, &mut fastrand::Rng::with_seed(2));
    state.normal = Vector3::z();
    state.world_from_body = UnitQuaternion::from_axis_angle(&Vector3::x_axis(), lean);
    let center = Vector3::new(0.0, circle - r * lean.sin(), r * lean.cos());
    state.base_position_m = center - state.world_from_body * Vector3::new(0.0, 0.0, -0.1);
    let omega = Vector3::z() * yaw_rate;
    let v = omega.cross(&state.base_position_m);
    state.velocity = vec![v.x, v.y, v.z, 0.0, 0.0, yaw_rate, -yaw_rate * circle / r];
    let a = omega.cross(&v);
    let mut now = Kinematics::new(&tree, &state.configuration());
    now.update(&tree, &state.configuration(), &state.velocity);
    now.accelerate(&tree, &[a.x, a.y, a.z, 0.0, 0.0, 0.0, 0.0]);
    let at = contact(&tree, &now.frames, &state, 0);
    assert!((at.position() - Vector3::new(0.0, circle, 0.0)).norm() < 1e-14); // rounding
    let motion = at.motion(&now);
    assert!(motion.material_velocity.norm() < 1e-14, "{}", motion.material_velocity); // rounding
    let along = omega.cross(&at.position());
    assert!((motion.geometric_velocity - along).norm() < 1e-14); // rounding
    assert!(motion.rolling_acceleration.norm() < 1e-12, "{}", motion.rolling_acceleration);
}

#[test]
fn a_wheel_that_lies_flat_has_no_lowest_point() {
    let tree = unicycle();
    let mut state = State::random(&tree, &mut fastrand::Rng::with_seed(3));
    state.world_from_body = UnitQuaternion::identity();
    let frames = Frames::new(&tree, &state.configuration());
    assert!(RimContact::new(&tree, &frames, 0, &Vector3::y()).is_none());
}

#[test]
#[should_panic(expected = "the wheel of `wheel` has 0.1 kg·m² about its axis")]
fn a_wheel_with_more_inertia_than_its_link_is_refused() {
    let _ = Tree::new(unicycle().robot()).with_spinning_wheels(|_| 0.1);
}

#[test]
#[should_panic(expected = "has NaN kg·m² about its axis")]
fn a_wheel_whose_inertia_is_no_number_is_refused() {
    let _ = Tree::new(unicycle().robot()).with_spinning_wheels(|_| f64::NAN);
}
