//! Tests of Jacobians and their time derivatives against finite differences.

use crate::robots::{State, for_random_states};
use nalgebra::{Matrix3xX, Vector3};
use rollwalk_multibody::{Frames, Kinematics, Tree};

/// Step of central differences, m or rad.
const STEP: f64 = 1e-5;
/// Accepted relative error. Values up to 10² with third derivatives up to 10³ give about 1e-7 from the step and as much from
/// rounding. A wheel that lies nearly flat, with a fast contact point, gives more.
const TOLERANCE: f64 = 1e-6;

fn kinematics(tree: &Tree, state: &State) -> Kinematics {
    let mut kinematics = Kinematics::new(tree, &state.configuration());
    kinematics.update(tree, &state.configuration(), &state.velocity);
    kinematics
}

/// Derivative of a vector with respect to each generalised velocity, by central differences.
pub fn difference(
    tree: &Tree,
    state: &State,
    value: impl Fn(&Frames) -> Vector3<f64>,
) -> Matrix3xX<f64> {
    let mut out = Matrix3xX::zeros(tree.dofs());
    for k in 0..tree.dofs() {
        let mut unit = vec![0.0; tree.dofs()];
        unit[k] = 1.0;
        let along = state.with_velocity(unit);
        let at = |time_s| value(&Frames::new(tree, &along.after(time_s).configuration()));
        out.set_column(k, &((at(STEP) - at(-STEP)) / (2.0 * STEP)));
    }
    out
}

/// Time derivative along ν, by central differences.
pub fn rate(state: &State, matrix: impl Fn(&State) -> Matrix3xX<f64>) -> Matrix3xX<f64> {
    (matrix(&state.after(STEP)) - matrix(&state.after(-STEP))) / (2.0 * STEP)
}

pub fn assert_near(found: &Matrix3xX<f64>, expected: &Matrix3xX<f64>, what: &str) {
    let error = (found - expected).amax() / (1.0 + expected.amax());
    assert!(error < TOLERANCE, "{what}: {error}");
}

/// Point of a link without special position.
const POINT_IN_LINK: Vector3<f64> = Vector3::new(0.03, -0.07, 0.11);

#[test]
fn point_jacobians_and_their_rates() {
    for_random_states(|tree, state| {
        let now = kinematics(tree, state);
        for link in 0..tree.robot().links.len() {
            let what = format!("{} link {link}", tree.robot().name);
            let jacobian = |state: &State| {
                let frames = Frames::new(tree, &state.configuration());
                let mut out = Matrix3xX::zeros(tree.dofs());
                frames.point_jacobian(tree, link, &frames.point(link, &POINT_IN_LINK), &mut out);
                out
            };
            let j = jacobian(state);
            assert_near(&j, &difference(tree, state, |f| f.point(link, &POINT_IN_LINK)), &what);

            let point = now.frames.point(link, &POINT_IN_LINK);
            let velocity = now.point_velocity(link, &point);
            let nu = nalgebra::DVector::from_column_slice(&state.velocity);
            assert!((&j * &nu - velocity).norm() < 1e-12, "{what}"); // rounding
            let mut j_dot = Matrix3xX::zeros(tree.dofs());
            now.point_jacobian_derivative(tree, link, &point, &velocity, &mut j_dot);
            assert_near(&j_dot, &rate(state, jacobian), &what);
            let bias = now.point_acceleration(link, &point);
            assert!((&j_dot * &nu - bias).norm() < 1e-11, "{what}"); // rounding
        }
    });
}

#[test]
fn angular_jacobians_and_their_rates() {
    for_random_states(|tree, state| {
        let now = kinematics(tree, state);
        for link in 0..tree.robot().links.len() {
            let what = format!("{} link {link}", tree.robot().name);
            let jacobian = |state: &State| {
                let frames = Frames::new(tree, &state.configuration());
                let mut out = Matrix3xX::zeros(tree.dofs());
                frames.angular_jacobian(tree, link, &mut out);
                out
            };
            let j = jacobian(state);
            // ω × v is the rate of any vector v of the link; three of them determine ω.
            for k in 0..3 {
                let rates = difference(tree, state, |f| f.world_from_link[link].column(k).into());
                let vector: Vector3<f64> = now.frames.world_from_link[link].column(k).into();
                let turned =
                    j.column_iter().map(|w| Vector3::from(w).cross(&vector)).collect::<Vec<_>>();
                assert_near(&Matrix3xX::from_columns(&turned), &rates, &what);
            }
            let mut j_dot = Matrix3xX::zeros(tree.dofs());
            now.angular_jacobian_derivative(tree, link, &mut j_dot);
            assert_near(&j_dot, &rate(state, jacobian), &what);
            let nu = nalgebra::DVector::from_column_slice(&state.velocity);
            assert!((&j * &nu - now.angular_velocity[link]).norm() < 1e-12, "{what}"); // rounding
            assert!((&j_dot * &nu - now.angular_acceleration[link]).norm() < 1e-11, "{what}");
        }
    });
}

#[test]
fn com_jacobian_and_its_rate() {
    for_random_states(|tree, state| {
        let name = &tree.robot().name;
        let jacobian = |state: &State| {
            let mut out = Matrix3xX::zeros(tree.dofs());
            Frames::new(tree, &state.configuration()).com_jacobian(tree, &mut out);
            out
        };
        let j = jacobian(state);
        assert_near(&j, &difference(tree, state, |frames| frames.com(tree)), name);
        let now = kinematics(tree, state);
        let mut j_dot = Matrix3xX::zeros(tree.dofs());
        now.com_jacobian_derivative(tree, &mut j_dot);
        assert_near(&j_dot, &rate(state, jacobian), name);
        let nu = nalgebra::DVector::from_column_slice(&state.velocity);
        assert!((&j * &nu - now.com_velocity(tree)).norm() < 1e-12, "{name}"); // rounding
        assert!((&j_dot * &nu - now.com_acceleration(tree)).norm() < 1e-11, "{name}"); // rounding
    });
}

#[test]
fn accelerations_are_jacobian_times_acceleration_plus_bias() {
    for_random_states(|tree, state| {
        let mut now = kinematics(tree, state);
        for link in 0..tree.robot().links.len() {
            let point = now.frames.point(link, &POINT_IN_LINK);
            let bias = now.point_acceleration(link, &point);
            let mut j = Matrix3xX::zeros(tree.dofs());
            now.frames.point_jacobian(tree, link, &point, &mut j);
            let nu_dot = nalgebra::DVector::from_column_slice(&state.acceleration);
            now.accelerate(tree, &state.acceleration);
            let error = now.point_acceleration(link, &point) - bias - j * nu_dot;
            assert!(error.norm() < 1e-11, "{} link {link}", tree.robot().name); // rounding
            now.update(tree, &state.configuration(), &state.velocity);
        }
    });
}
