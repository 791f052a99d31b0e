//! Linear model of the robot near its plan: a rigid body in place of the legs, with forces at the end effectors (closed loop of
//! thesis sec. 3.6).
//!
//! ```text
//! state  errors δc, δθ, δv, δω of centre of mass and body, and δp of each end effector, horizontally
//! input  δf, error of the ground force on each standing end effector; u, speed of each end effector minus the planned speed,
//!        horizontally
//!
//! δċ = δv    m δv̇ = Σ δf    δθ̇ = δω    I δω̇ = Σ (p − c) × δf + Σ δp × f − δc × Σ f    δṗ = u
//! ```
//!
//! A wheel or blade on the ground moves only along its direction of travel, a foot on the ground not at all. All vectors are in
//! axes whose x is the planned heading of the body, so that a periodic motion that turns has equal matrices in every period.

use crate::reference::Reference;
use nalgebra::{DMatrix, Matrix3, Matrix6xX, Rotation3, Vector3};
use rollwalk_multibody::{
    ANGULAR, CompositeInertia, Kinematics, RimContact, Tree, centroidal_momentum_matrix, rotation,
};
use rollwalk_robot::GRAVITY_M_S2;

/// Index of δc, the error of the centre of mass, in the state.
pub(crate) const COM: usize = 0;
/// Index of the rotation error δθ in the state.
pub(crate) const TURN: usize = 3;
/// Index of the velocity error δv in the state.
pub(crate) const VELOCITY: usize = 6;
/// Index of the error δω of the angular velocity in the state.
pub(crate) const SPIN: usize = 9;
/// Index of the position error δp of the first end effector in the state.
pub(crate) const FEET: usize = 12;

/// Length of the state.
pub(crate) fn states(feet: usize) -> usize {
    FEET + 2 * feet
}

/// Length of the input: forces of all end effectors, then their speeds.
pub(crate) fn inputs(feet: usize) -> usize {
    5 * feet
}

/// Index of the first component of an end effector's speed in the input.
pub(crate) fn speed_of(foot: usize, feet: usize) -> usize {
    3 * feet + 2 * foot
}

/// Weights of squared errors and inputs, per second.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Costs {
    /// Weight of the position of the centre of mass, per m².
    pub com: f64,
    /// Weight of the rotation of the body, per rad².
    pub turn: f64,
    /// Weight of the velocity of the centre of mass, per (m/s)².
    pub velocity: f64,
    /// Weight of the angular velocity of the body, per (rad/s)².
    pub spin: f64,
    /// Weight of the position of an end effector relative to the body, per m².
    pub foot: f64,
    /// Weight of the ground force, per square of the robot's weight.
    pub force: f64,
    /// Weight of the rolling speed of a wheel on the ground, per (m/s)². The inertia of its rotor has to be accelerated.
    pub roll: f64,
    /// Weight of the speed of an end effector in the air, per (m/s)².
    pub swing: f64,
}

impl Default for Costs {
    /// Default weights for all robots. docs/measured/tracking.md contains their results on the shipped plans.
    fn default() -> Self {
        Self {
            com: 200.0,
            turn: 60.0,
            velocity: 8.0,
            spin: 1.5,
            foot: 60.0,
            force: 4.0,
            roll: 3.0,
            swing: 0.6,
        }
    }
}

/// Linear model at one time of the plan, in continuous time and in heading axes.
#[derive(Clone, Debug)]
pub(crate) struct Moment {
    /// Planned heading of the body, rad.
    pub heading_rad: f64,
    /// Matrix A of ẋ = A x + B u.
    pub a: DMatrix<f64>,
    /// Matrix B of ẋ = A x + B u.
    pub b: DMatrix<f64>,
    /// Matrix Q of the costs xᵀ Q x + uᵀ R u per second.
    pub q: DMatrix<f64>,
    /// Diagonal matrix R of the costs xᵀ Q x + uᵀ R u per second.
    pub r: DMatrix<f64>,
}

/// Linearisation of plans of one robot.
pub(crate) struct PlanModel {
    kinematics: Kinematics,
    composite: CompositeInertia,
    mass: DMatrix<f64>,
    momentum: Matrix6xX<f64>,
}

impl PlanModel {
    pub fn new(tree: &Tree) -> Self {
        let still = rollwalk_multibody::State::nominal(tree);
        let kinematics = Kinematics::new(tree, &still.configuration());
        Self {
            composite: CompositeInertia::new(tree, &kinematics.frames),
            kinematics,
            mass: DMatrix::zeros(tree.dofs(), tree.dofs()),
            momentum: Matrix6xX::zeros(tree.dofs()),
        }
    }

    /// Linearises the system about a reference.
    pub fn about(&mut self, tree: &Tree, costs: &Costs, reference: &Reference) -> Moment {
        let Self { kinematics, composite, mass, momentum } = self;
        let state = &reference.state;
        kinematics.update(tree, &state.configuration(), &state.velocity);
        let frames = &kinematics.frames;
        composite.update(tree, frames);
        composite.mass_matrix(tree, frames, mass);
        let com = frames.com(tree);
        centroidal_momentum_matrix(mass, &(com - frames.link_origins[0]), momentum);
        let inertia: Matrix3<f64> = momentum.fixed_view::<3, 3>(ANGULAR, ANGULAR).into();
        let heading_rad = heading_rad(&state.world_from_body);
        let heading_from_world = Rotation3::from_axis_angle(&Vector3::z_axis(), -heading_rad);
        let turned = |v: Vector3<f64>| heading_from_world * v;
        let inertia = heading_from_world * inertia * heading_from_world.transpose();
        let per_inertia = inertia.try_inverse().expect("bodies have inertia");

        let robot = tree.robot();
        let feet = robot.end_effectors.len();
        let (n, m) = (states(feet), inputs(feet));
        let weight_n = tree.total_mass_kg() * GRAVITY_M_S2;
        let mut moment = Moment {
            heading_rad,
            a: DMatrix::zeros(n, n),
            b: DMatrix::zeros(n, m),
            q: DMatrix::zeros(n, n),
            r: DMatrix::identity(m, m),
        };
        let Moment { a, b, q, r, .. } = &mut moment;
        a.fixed_view_mut::<3, 3>(COM, VELOCITY).fill_with_identity();
        a.fixed_view_mut::<3, 3>(TURN, SPIN).fill_with_identity();
        for (at, price) in
            [(COM, costs.com), (TURN, costs.turn), (VELOCITY, costs.velocity), (SPIN, costs.spin)]
        {
            (at..at + 3).for_each(|k| q[(k, k)] = price);
        }
        let mut sum = Vector3::zeros();
        for (j, end_effector) in robot.end_effectors.iter().enumerate() {
            let contact = RimContact::new(tree, frames, j, &Vector3::z());
            let (point, way) = match &contact {
                Some(contact) => (contact.position(), contact.axis.cross(&Vector3::z())),
                None => (
                    frames.point(end_effector.link, &end_effector.center_in_link_m),
                    Vector3::zeros(),
                ),
            };
            let lever = turned(point - com);
            let (place, speed) = (FEET + 2 * j, speed_of(j, feet));
            if reference.stands[j] {
                let force = turned(reference.force_n[j]);
                sum += force;
                let moves = -per_inertia * rotation::skew(&force);
                a.fixed_view_mut::<3, 2>(SPIN, place).copy_from(&moves.fixed_view::<3, 2>(0, 0));
                let turns = per_inertia * rotation::skew(&lever);
                b.fixed_view_mut::<3, 3>(SPIN, 3 * j).copy_from(&turns);
                for k in 0..3 {
                    b[(VELOCITY + k, 3 * j + k)] = 1.0 / tree.total_mass_kg();
                    r[(3 * j + k, 3 * j + k)] = costs.force / (weight_n * weight_n);
                }
            }
            let swings = !reference.stands[j];
            let way = turned(way).try_normalize(1e-9);
            let contact = &end_effector.contact;
            let glides = contact.rolls() || contact.blade_length_m().is_some();
            for row in 0..2 {
                for column in 0..2 {
                    b[(place + row, speed + column)] = match way {
                        _ if swings => f64::from(u8::from(row == column)),
                        Some(way) if glides => way[row] * way[column],
                        _ => 0.0,
                    };
                }
                r[(speed + row, speed + row)] = if swings { costs.swing } else { costs.roll };
            }
            // Position of the end effector relative to the body: δp − δc − δθ × lever.
            let mut seen = DMatrix::zeros(2, n);
            let turns = rotation::skew(&lever);
            for row in 0..2 {
                seen[(row, place + row)] = 1.0;
                seen[(row, COM + row)] = -1.0;
                for k in 0..3 {
                    seen[(row, TURN + k)] = turns[(row, k)];
                }
            }
            q.gemm_tr(costs.foot, &seen, &seen, 1.0);
        }
        let falls = per_inertia * rotation::skew(&sum);
        a.fixed_view_mut::<3, 3>(SPIN, COM).copy_from(&falls);
        moment
    }
}

/// Heading of the body's x axis, rad.
pub(crate) fn heading_rad(world_from_body: &Matrix3<f64>) -> f64 {
    world_from_body[(1, 0)].atan2(world_from_body[(0, 0)])
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{DVector, Isometry3, UnitQuaternion};
    use rollwalk_multibody::State;
    use rollwalk_robot::Robot;

    /// Reference: linear and angular acceleration of a rigid body from its ground forces, without gravity, for errors of state
    /// and input, in axes of the heading.
    fn accelerations(
        levers: &[Vector3<f64>],
        forces: &[Vector3<f64>],
        [mass_kg, feet]: [f64; 2],
        inertia: &Matrix3<f64>,
        [x, u]: [&DVector<f64>; 2],
    ) -> DVector<f64> {
        let feet = feet as usize;
        let shift = x.fixed_rows::<3>(COM).into_owned();
        let (mut force, mut moment) = (Vector3::zeros(), Vector3::zeros());
        for j in 0..feet {
            let off = Vector3::new(x[FEET + 2 * j], x[FEET + 2 * j + 1], 0.0) - shift;
            let here = forces[j] + u.fixed_rows::<3>(3 * j);
            force += here;
            moment += (levers[j] + off).cross(&here);
        }
        let angular = inertia.try_inverse().unwrap() * moment;
        DVector::from_iterator(6, (force / mass_kg).iter().chain(angular.iter()).copied())
    }

    #[test]
    fn the_system_is_the_derivative_of_a_rigid_body_that_turns_with_its_heading() {
        let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../../shipped/robots/anymal_wheels.toml");
        let text = std::fs::read_to_string(path).unwrap();
        let robot = Robot::from_toml("anymal_wheels", &text).unwrap();
        let tree = Tree::new(&robot).with_spinning_wheels(|_| 1e-3).with_armature();
        let mut state = State::nominal(&tree);
        state.world_from_body =
            UnitQuaternion::from_euler_angles(0.1, -0.05, 0.8).to_rotation_matrix().into_inner();
        let forces: Vec<_> =
            (0..4).map(|j| Vector3::new(3.0 * j as f64, -10.0, 60.0 + 20.0 * j as f64)).collect();
        let reference = Reference {
            time_s: 0.0,
            world_from_ground: Isometry3::identity(),
            acceleration: vec![0.0; tree.dofs()],
            stands: vec![true; 4],
            ground_height_m: vec![0.0; forces.len()],
            ground_normal: vec![Vector3::z(); forces.len()],
            force_n: forces.clone(),
            state,
        };
        let mut model = PlanModel::new(&tree);
        let moment = model.about(&tree, &Costs::default(), &reference);
        let kinematics = &model.kinematics;
        let turn = Rotation3::from_axis_angle(&Vector3::z_axis(), -moment.heading_rad);
        let com = kinematics.frames.com(&tree);
        let levers: Vec<_> = (0..4)
            .map(|j| {
                let contact = RimContact::new(&tree, &kinematics.frames, j, &Vector3::z()).unwrap();
                turn * (contact.position() - com)
            })
            .collect();
        let forces: Vec<_> = forces.iter().map(|force| turn * force).collect();
        let inertia: Matrix3<f64> = model.momentum.fixed_view::<3, 3>(ANGULAR, ANGULAR).into();
        let inertia = turn * inertia * turn.transpose();
        let at = |x: &DVector<f64>, u: &DVector<f64>| {
            let size = [tree.total_mass_kg(), 4.0];
            accelerations(&levers, &forces, size, &inertia, [x, u])
        };
        let (x, u) = (DVector::zeros(states(4)), DVector::zeros(inputs(4)));
        let step = 1e-6;
        for k in 0..x.len() + u.len() {
            let shifted = |by: f64| {
                let (mut x, mut u) = (x.clone(), u.clone());
                if k < x.len() {
                    x[k] += by
                } else {
                    u[k - x.len()] += by
                }
                at(&x, &u)
            };
            let slope = (shifted(step) - shifted(-step)) / (2.0 * step);
            let column =
                if k < x.len() { moment.a.column(k) } else { moment.b.column(k - x.len()) };
            let error = (column.rows(VELOCITY, 6) - &slope).amax();
            assert!(error < 1e-7 * (1.0 + slope.amax()), "{k}: {error} {slope}");
        }
        // Wheels move along their heading, which is 0.8 rad from the world's x axis and, except for the tilt of the body, along
        // x here.
        let speed = moment.b.view((FEET, speed_of(0, 4)), (2, 2)).into_owned();
        assert!((speed[(0, 0)] - 1.0).abs() < 0.02 && speed[(1, 1)].abs() < 0.02, "{speed}");
    }
}
