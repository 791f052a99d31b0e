//! Tests of mass matrix, bias forces and momentum: against each other, against sums over links, and along motions.

use crate::robots::{State, all, for_random_states, full_tree, sprung};
use nalgebra::{DMatrix, DVector, Matrix3, Matrix3xX, Matrix6xX, Vector3, Vector6};
use rollwalk_multibody::{
    ANGULAR, CompositeInertia, Configuration, Frames, Kinematics, Tree, about_com,
    centroidal_momentum_matrix, forward_dynamics,
};

fn mass_matrix(tree: &Tree, at: &Configuration) -> DMatrix<f64> {
    let frames = Frames::new(tree, at);
    let mut out = DMatrix::zeros(tree.dofs(), tree.dofs());
    CompositeInertia::new(tree, &frames).mass_matrix(tree, &frames, &mut out);
    out
}

/// Generalised forces τ = M ν̇ + h by the Newton–Euler method.
fn inverse_dynamics(
    tree: &Tree,
    at: &Configuration,
    velocity: &[f64],
    acceleration: &[f64],
    gravity_m_s2: &Vector3<f64>,
) -> DVector<f64> {
    let mut kinematics = Kinematics::new(tree, at);
    kinematics.update(tree, at, velocity);
    kinematics.accelerate(tree, acceleration);
    let mut out = DVector::zeros(tree.dofs());
    kinematics.inverse_dynamics(tree, gravity_m_s2, out.as_mut_slice());
    out
}

fn momentum_matrix(tree: &Tree, at: &Configuration) -> Matrix6xX<f64> {
    let mut out = Matrix6xX::zeros(tree.dofs());
    let to_com = Frames::new(tree, at).com(tree) - at.base_position_m;
    centroidal_momentum_matrix(&mass_matrix(tree, at), &to_com, &mut out);
    out
}

#[test]
fn composite_bodies_and_newton_euler_agree() {
    for_random_states(|tree, state| {
        let at = state.configuration();
        let m = mass_matrix(tree, &at);
        let still = vec![0.0; tree.dofs()];
        for k in 0..tree.dofs() {
            let mut unit = still.clone();
            unit[k] = 1.0;
            let column = inverse_dynamics(tree, &at, &still, &unit, &Vector3::zeros());
            let error = (m.column(k) - column).amax();
            assert!(error < 1e-13 * m.amax(), "{} column {k}: {error}", tree.robot().name);
        }
        assert!((&m - m.transpose()).amax() < 1e-15 * m.amax(), "{}", tree.robot().name); // rounding
        assert!(m.cholesky().is_some(), "{}", tree.robot().name);
    });
}

#[test]
fn kinetic_energy_is_the_sum_over_links_and_wheels() {
    for_random_states(|tree, state| {
        let at = state.configuration();
        let nu = DVector::from_column_slice(&state.velocity);
        let mut now = Kinematics::new(tree, &at);
        now.update(tree, &at, &state.velocity);
        let mut energy = 0.0;
        for (l, link) in tree.robot().links.iter().enumerate() {
            let w = now.angular_velocity[l];
            let v = now.point_velocity(l, &now.frames.link_com(tree, l));
            energy +=
                link.mass_kg * v.norm_squared() + w.dot(&(now.frames.link_inertia(tree, l) * w));
        }
        for wheel in tree.wheels() {
            // The wheel rotates with its link and about its axis. Its own share replaces the link's.
            let speed = state.velocity[tree.wheel_dof(wheel.end_effector).unwrap()];
            let axis = now.frames.world_from_link[wheel.link] * wheel.axis_in_link;
            let carried = axis.dot(&now.angular_velocity[wheel.link]);
            energy += wheel.spin_inertia_kg_m2 * ((carried + speed).powi(2) - carried.powi(2));
            energy += wheel.armature_kg_m2 * speed * speed;
        }
        let joints = tree.robot().joints.len();
        let motor_speeds = now.frames.ratios(tree).motors(&state.velocity[6..6 + joints]);
        for (joint, speed) in tree.robot().joints.iter().zip(&motor_speeds) {
            energy += joint.actuator.armature_kg_m2 * speed * speed;
        }
        let from_matrix = nu.dot(&(mass_matrix(tree, &at) * &nu));
        assert!((from_matrix - energy).abs() < 1e-12 * energy, "{}", tree.robot().name);
    });
}

#[test]
fn half_the_rate_of_the_mass_matrix_and_the_bias_forces_do_the_same_work() {
    // νᵀ (Ṁ − 2 C) ν = 0: forces of motion neither create nor destroy energy.
    let step = 1e-5; // error about step² and 1e-16/step, times numbers up to 10²
    for_random_states(|tree, state| {
        let nu = DVector::from_column_slice(&state.velocity);
        let m = |time_s: f64| mass_matrix(tree, &state.after(time_s).configuration());
        let rate = (m(step) - m(-step)) / (2.0 * step);
        let still = vec![0.0; tree.dofs()];
        let at = state.configuration();
        let bias = inverse_dynamics(tree, &at, &state.velocity, &still, &Vector3::zeros());
        let (power, expected) = (nu.dot(&bias), 0.5 * nu.dot(&(rate * &nu)));
        let scale = nu.norm() * bias.norm() + 1.0;
        assert!((power - expected).abs() < 1e-7 * scale, "{}: {power}", tree.robot().name);
    });
}

#[test]
fn weight_is_the_gradient_of_potential_energy() {
    for_random_states(|tree, state| {
        let at = state.configuration();
        let still = vec![0.0; tree.dofs()];
        let weight = inverse_dynamics(tree, &at, &still, &still, &state.gravity_m_s2);
        let mut com = Matrix3xX::zeros(tree.dofs());
        Frames::new(tree, &at).com_jacobian(tree, &mut com);
        let expected = com.tr_mul(&state.gravity_m_s2) * -tree.total_mass_kg();
        assert!((weight - expected).amax() < 1e-12, "{}", tree.robot().name); // rounding
    });
}

#[test]
fn springs_and_dampers_do_their_part_of_the_work() {
    for robot in all() {
        let sprung = sprung(&robot);
        let [without, with] = [&robot, &sprung].map(full_tree);
        let state = State::random(&without, &mut fastrand::Rng::with_seed(7));
        let gravity = state.gravity_m_s2;
        let force = |tree: &Tree| {
            inverse_dynamics(
                tree,
                &state.configuration(),
                &state.velocity,
                &state.acceleration,
                &gravity,
            )
        };
        let mut expected = force(&without);
        for (j, joint) in sprung.joints.iter().enumerate() {
            let spring = joint.spring.unwrap();
            expected[6 + j] += spring.stiffness_nm_rad * (state.joint_rad[j] - spring.rest_rad)
                + spring.damping_nm_s_rad * state.velocity[6 + j];
        }
        assert!((force(&with) - expected).amax() < 1e-12, "{}", robot.name); // rounding
    }
}

#[test]
fn forward_dynamics_undoes_inverse_dynamics() {
    for_random_states(|tree, state| {
        let at = state.configuration();
        let gravity = state.gravity_m_s2;
        let still = vec![0.0; tree.dofs()];
        let bias = inverse_dynamics(tree, &at, &state.velocity, &still, &gravity);
        let force = inverse_dynamics(tree, &at, &state.velocity, &state.acceleration, &gravity);
        let found = forward_dynamics(mass_matrix(tree, &at), &bias, &force).unwrap();
        let expected = DVector::from_column_slice(&state.acceleration);
        // The mass matrix spans five orders of magnitude.
        assert!((found - expected).amax() < 1e-9, "{}", tree.robot().name);
    });
}

#[test]
fn momentum_and_its_rate() {
    let step = 1e-5;
    for_random_states(|tree, state| {
        let name = &tree.robot().name;
        let at = state.configuration();
        let nu = DVector::from_column_slice(&state.velocity);
        let a = momentum_matrix(tree, &at);
        let mut com = Matrix3xX::zeros(tree.dofs());
        let frames = Frames::new(tree, &at);
        frames.com_jacobian(tree, &mut com);
        let linear = a.fixed_rows::<3>(0) - com * tree.total_mass_kg();
        assert!(linear.amax() < 1e-12, "{name}"); // rounding
        let locked: Matrix3<f64> = a.fixed_view::<3, 3>(3, ANGULAR).into();
        assert!((locked - frames.centroidal_inertia(tree)).amax() < 1e-12, "{name}"); // rounding

        let momentum = |time_s: f64| -> Vector6<f64> {
            momentum_matrix(tree, &state.after(time_s).configuration()) * &nu
        };
        let rate = (momentum(step) - momentum(-step)) / (2.0 * step);
        let still = vec![0.0; tree.dofs()];
        let bias = inverse_dynamics(tree, &at, &state.velocity, &still, &Vector3::zeros());
        let to_com = frames.com(tree) - at.base_position_m;
        let found = about_com(bias.as_slice(), &to_com);
        assert!((found - rate).amax() < 1e-7 * (1.0 + rate.amax()), "{name}");
    });
}

/// Position, rotation matrix, joint angles and ν of a robot in free flight.
#[derive(Clone)]
struct Flight {
    position: Vector3<f64>,
    rotation: Matrix3<f64>,
    joint_rad: DVector<f64>,
    velocity: DVector<f64>,
}

impl Flight {
    fn configuration(&self) -> Configuration<'_> {
        Configuration {
            base_position_m: self.position,
            world_from_body: self.rotation,
            joint_rad: self.joint_rad.as_slice(),
        }
    }

    /// Rates of the entries without forces.
    fn rates(&self, tree: &Tree) -> Self {
        let at = self.configuration();
        let still = vec![0.0; tree.dofs()];
        let v = self.velocity.as_slice();
        let bias = inverse_dynamics(tree, &at, v, &still, &Vector3::zeros());
        let free = DVector::zeros(tree.dofs());
        let omega = Vector3::new(v[3], v[4], v[5]);
        Self {
            position: Vector3::new(v[0], v[1], v[2]),
            rotation: omega.cross_matrix() * self.rotation,
            joint_rad: self.velocity.rows(6, self.joint_rad.len()).into(),
            velocity: forward_dynamics(mass_matrix(tree, &at), &bias, &free).unwrap(),
        }
    }

    fn plus(&self, rates: &Self, time_s: f64) -> Self {
        Self {
            position: self.position + rates.position * time_s,
            rotation: self.rotation + rates.rotation * time_s,
            joint_rad: &self.joint_rad + &rates.joint_rad * time_s,
            velocity: &self.velocity + &rates.velocity * time_s,
        }
    }

    /// Advances by one step of the classical Runge–Kutta method.
    fn step(&self, tree: &Tree, time_s: f64) -> Self {
        let k1 = self.rates(tree);
        let k2 = self.plus(&k1, 0.5 * time_s).rates(tree);
        let k3 = self.plus(&k2, 0.5 * time_s).rates(tree);
        let k4 = self.plus(&k3, time_s).rates(tree);
        let sixth = time_s / 6.0;
        self.plus(&k1, sixth).plus(&k2, 2.0 * sixth).plus(&k3, 2.0 * sixth).plus(&k4, sixth)
    }
}

#[test]
fn free_flight_keeps_energy_and_momentum() {
    for name in ["agilebot", "skatebot", "creature3"] {
        let robot = all().into_iter().find(|robot| robot.name == name).unwrap();
        let tree = full_tree(&robot);
        let state = State::random(&tree, &mut fastrand::Rng::with_seed(11));
        let mut flight = Flight {
            position: state.base_position_m,
            rotation: state.world_from_body.to_rotation_matrix().into_inner(),
            joint_rad: DVector::from_column_slice(&state.joint_rad),
            velocity: DVector::from_column_slice(&state.velocity),
        };
        let invariants = |flight: &Flight| {
            let v = &flight.velocity;
            let energy = 0.5 * v.dot(&(mass_matrix(&tree, &flight.configuration()) * v));
            (energy, momentum_matrix(&tree, &flight.configuration()) * v)
        };
        let (energy, momentum) = invariants(&flight);
        let started = flight.velocity.clone();
        for _ in 0..200 {
            flight = flight.step(&tree, 5e-4);
        }
        let (energy_after, momentum_after) = invariants(&flight);
        assert!((flight.velocity - started).amax() > 0.1, "{name} has moved");
        // Fourth order: 0.1 s in steps of 0.5 ms at accelerations of some 10² rad/s².
        assert!((energy_after / energy - 1.0).abs() < 1e-8, "{name}: {energy} {energy_after}");
        let drift = (momentum_after - momentum).amax() / momentum.amax();
        assert!(drift < 1e-8, "{name}: {drift}");
    }
}
