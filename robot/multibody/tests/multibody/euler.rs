//! Tests of the optimiser's coordinates: derivatives against finite differences, and against ν.

use crate::robots::{all, numbers};
use nalgebra::{DMatrix, DVector, Matrix3xX, Matrix6xX, Vector3};
use rollwalk_multibody::euler::{BASE_YAW, Model};
use rollwalk_multibody::{ANGULAR, CompositeInertia, centroidal_momentum_matrix};
use rollwalk_robot::Robot;

/// Random configuration: any base position, tilt below a quarter turn, joints within their limits.
fn random_q(robot: &Robot, seed: u64) -> DVector<f64> {
    let mut rng = fastrand::Rng::with_seed(seed);
    let mut q = numbers(6, 1.0, &mut rng);
    let range = |j: &rollwalk_robot::Joint| j.position_max_rad - j.position_min_rad;
    q.extend(robot.joints.iter().map(|j| j.position_min_rad + rng.f64() * range(j)));
    DVector::from_vec(q)
}

#[test]
fn derivatives_match_finite_differences_at_random_poses() {
    let step = 1e-6; // central differences: error about step² + 1e-16/step = 1e-10
    for robot in all() {
        let model = Model::new(&robot);
        for seed in 0..3 {
            let q = random_q(&robot, seed);
            let pose = model.pose(&q);
            for k in 0..model.dofs() {
                let (mut plus, mut minus) = (q.clone(), q.clone());
                plus[k] += step;
                minus[k] -= step;
                let (plus, minus) = (model.pose(&plus), model.pose(&minus));
                let com = (plus.com - minus.com) / (2.0 * step);
                assert!((com - pose.d_com[k]).norm() < 1e-8, "{} com {k}", robot.name);
                for (index, at) in pose.end_effectors.iter().enumerate() {
                    let (p, m) = (&plus.end_effectors[index], &minus.end_effectors[index]);
                    let column = model.chain(index).dofs.iter().position(|&d| d == k);
                    let zero = Vector3::zeros();
                    let (d_center, d_axis) =
                        column.map_or((zero, zero), |c| (at.d_center[c], at.d_axis[c]));
                    let center = (p.center - m.center) / (2.0 * step);
                    let axis = (p.axis - m.axis) / (2.0 * step);
                    assert!((center - d_center).norm() < 1e-8, "{} center", robot.name);
                    assert!((axis - d_axis).norm() < 1e-8, "{} axis", robot.name);
                }
            }
        }
    }
}

#[test]
fn rates_of_yaw_pitch_and_roll_are_an_angular_velocity() {
    for robot in all() {
        let model = Model::new(&robot);
        let q = random_q(&robot, 5);
        let rates = DVector::from_vec(numbers(model.dofs(), 1.0, &mut fastrand::Rng::with_seed(6)));
        let pose = model.pose(&q);
        let mut velocity = rates.clone();
        let omega: Vector3<f64> =
            pose.base_axes.iter().zip(rates.rows(BASE_YAW, 3).iter()).map(|(w, v)| w * *v).sum();
        velocity.rows_mut(BASE_YAW, 3).copy_from(&omega);
        let mut jacobian = Matrix3xX::zeros(model.dofs());
        model.frames(&q).com_jacobian(model.tree(), &mut jacobian);
        let error = Matrix3xX::from_columns(&pose.d_com) * rates - jacobian * velocity;
        assert!(error.norm() < 1e-14, "{}: {error}", robot.name); // rounding
    }
}

#[test]
fn the_nominal_pose_touches_the_ground_and_is_not_below_it() {
    for robot in all() {
        let model = Model::new(&robot);
        let pose = model.pose(model.nominal_q());
        let drop = |axis: &Vector3<f64>, radius_m: f64| radius_m * axis.x.hypot(axis.y);
        let lowest = robot
            .end_effectors
            .iter()
            .zip(&pose.end_effectors)
            .map(|(ee, at)| match ee.contact.axis_in_link() {
                Some(_) => at.center.z - drop(&at.axis, ee.radius_m),
                None => at.center.z - ee.radius_m,
            })
            .fold(f64::INFINITY, f64::min);
        assert!(lowest.abs() < 1e-12, "{}: {lowest}", robot.name); // rounding only
    }
}

#[test]
fn the_swept_moment_is_angular_momentum_over_a_short_interval() {
    for robot in all() {
        let model = Model::new(&robot);
        let q = random_q(&robot, 8);
        let rates = DVector::from_vec(numbers(model.dofs(), 1.0, &mut fastrand::Rng::with_seed(9)));
        let h = 1e-4;
        let at = |t: f64| model.pose(&(&q + &rates * t));
        let (before, here, after) = (at(-0.5 * h), at(0.0), at(0.5 * h));
        let moment = model.swept_moment(&before, &after).value / h;
        // Momentum of every link about the centre of mass, only from the rates.
        let mut velocity = rates.clone();
        let omega: Vector3<f64> =
            here.base_axes.iter().zip(rates.rows(BASE_YAW, 3).iter()).map(|(w, v)| w * *v).sum();
        velocity.rows_mut(BASE_YAW, 3).copy_from(&omega);
        let (tree, frames) = (model.tree(), model.frames(&q));
        let mut mass = DMatrix::zeros(model.dofs(), model.dofs());
        CompositeInertia::new(tree, &frames).mass_matrix(tree, &frames, &mut mass);
        let mut momentum = Matrix6xX::zeros(model.dofs());
        let base_to_com = here.com - frames.link_origins[0];
        centroidal_momentum_matrix(&mass, &base_to_com, &mut momentum);
        let expected: Vector3<f64> = (momentum * velocity).fixed_rows::<3>(ANGULAR).into();
        // Second order in h, and rounding of moments of inertia over h.
        assert!((moment - expected).norm() < 1e-7 * (1.0 + expected.norm()), "{}", robot.name);
    }
}

#[test]
fn derivatives_of_the_swept_moment_match_finite_differences() {
    let step = 1e-6; // as above
    for robot in all() {
        let model = Model::new(&robot);
        let (q, next) = (random_q(&robot, 1), random_q(&robot, 2));
        let swept = |q: &DVector<f64>, next: &DVector<f64>| {
            model.swept_moment(&model.pose(q), &model.pose(next))
        };
        let exact = swept(&q, &next);
        for k in 0..model.dofs() {
            let shifted = |q: &DVector<f64>, by: f64| {
                let mut q = q.clone();
                q[k] += by;
                q
            };
            let from =
                swept(&shifted(&q, step), &next).value - swept(&shifted(&q, -step), &next).value;
            let to =
                swept(&q, &shifted(&next, step)).value - swept(&q, &shifted(&next, -step)).value;
            // The base's position has no effect.
            let column =
                |d: &[Vector3<f64>]| if k < BASE_YAW { Vector3::zeros() } else { d[k - BASE_YAW] };
            let size = 1.0 + exact.value.norm();
            assert!(
                (from / (2.0 * step) - column(&exact.d_from)).norm() < 1e-8 * size,
                "{} {k}",
                robot.name
            );
            assert!(
                (to / (2.0 * step) - column(&exact.d_to)).norm() < 1e-8 * size,
                "{} {k}",
                robot.name
            );
        }
    }
}
