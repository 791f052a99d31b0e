//! Tests of inverse problems: parameters found from a desired or an observed rollout.

use nalgebra::{Matrix3, Vector3};
use rollwalk_multibody::ground::{Ground, Plane};
use rollwalk_physics::contact::{GroundContact, Normal, Resistance, Tip};
use rollwalk_physics::curve::{Curve, Degree};
use rollwalk_physics::friction::{Friction, FrictionModel};
use rollwalk_physics::motor::Motor;
use rollwalk_physics::sensitivity::gauss_newton::{Evaluation, Fit, Options, Penalty, minimise};
use rollwalk_physics::sensitivity::parameter::{
    BodyMass, ContactParameter, ContactQuantity, Control, Freedom, Initial, MassQuantity,
};
use rollwalk_physics::sensitivity::{Constant, Health, Parameter, Recorder, Residual, Rollout};
use rollwalk_physics::world::Parameters;
use rollwalk_physics::{
    Assembly, BodyMotion, ContactChange, Inertia, Scheme, Settings, System, World,
};
use rollwalk_robot::{Channel, Robot};
use std::f64::consts::TAU;
use std::sync::Arc;

fn settings(scheme: Scheme) -> Settings {
    Settings { scheme, tolerance: 1e-10, ..Settings::default() }
}

/// Builds a ball above level ground, or a box on it.
fn thrown(points: &[Vector3<f64>], radius_m: f64, motion: BodyMotion) -> System {
    let mut assembly = Assembly::default();
    let about_com_kg_m2 = Matrix3::identity() * 2e-3;
    assembly.add_body(Inertia { mass_kg: 1.0, about_com_kg_m2 }, motion);
    let ground: Arc<dyn Ground> = Arc::new(Plane::level());
    for &center in points {
        assembly.add(GroundContact {
            body: [0],
            center,
            radius_m,
            tip: Tip::Sphere,
            normal: Normal { stiffness_n_m: 1e3, damping_n_s_m: 4.0, ramp_m: 1e-3, pulls: true },
            friction: Friction { model: FrictionModel::Tanh, coefficient: 0.4, stick_n_s_m: 30.0 },
            resistance: Resistance::default(),
            ground: Arc::clone(&ground),
        });
    }
    System::new(settings(Scheme::Bdf2), assembly)
}

/// Tests that a ball with a given spin is thrown so that it reaches a target after a bounce.
#[test]
fn a_throw_finds_its_target_with_a_bounce() {
    let aim = [Vector3::x(), Vector3::y(), Vector3::z()].map(|axis| Initial {
        bodies: vec![0],
        freedom: Freedom::Velocity,
        axis,
    });
    let target = Vector3::new(0.9, 0.2, 0.2);
    let motion = BodyMotion {
        velocity: Vector3::new(1.0, 0.0, 1.0),
        spin: Vector3::y() * -6.0,
        ..BodyMotion::at(Vector3::z() * 0.3)
    };
    let run = |velocity: &[f64]| {
        let mut system = thrown(&[Vector3::zeros()], 0.05, motion);
        aim.iter().zip(velocity).for_each(|(aim, by)| aim.vary(&mut system, *by));
        let parameters = aim.iter().map(|aim| -> Box<dyn Parameter> { Box::new(aim.clone()) });
        let mut recorder = Recorder::new(&system, parameters.collect());
        for _ in 0..160 {
            system.step_recorded(1.0 / 240.0, &mut recorder).ok()?;
        }
        Some(recorder.finish())
    };
    let evaluate = |velocity: &[f64]| {
        let rollout = run(velocity)?;
        let miss = |axis| Residual::position(&rollout, rollout.steps(), 0, &target, axis);
        let residuals = [Vector3::x(), Vector3::y(), Vector3::z()].map(miss).to_vec();
        Some(Evaluation::from((rollout, residuals)))
    };
    let options = Options { tolerance: 1e-12, ..Options::default() };
    let fit = minimise(&[0.0; 3], &[], &options, evaluate).unwrap();
    assert!(fit.costs[fit.costs.len() - 1] < 1e-20 * fit.costs[0], "{fit:?}");
    assert!(fit.rollouts <= 15, "{fit:?}");
    let rollout = run(&fit.parameters).unwrap();
    let events = rollout.reports().iter().flat_map(|report| &report.events);
    let bounces = events.filter(|event| matches!(event.change, ContactChange::TouchDown { .. }));
    assert_eq!(bounces.count(), 1);
}

const CORNERS: [Vector3<f64>; 4] = [
    Vector3::new(0.1, 0.06, -0.03),
    Vector3::new(0.1, -0.06, -0.03),
    Vector3::new(-0.1, 0.06, -0.03),
    Vector3::new(-0.1, -0.06, -0.03),
];

/// Simulates a box that slides to a stop. The parameters are the logarithm of its friction coefficient, and its speed.
fn slide(p: &[f64]) -> Option<Rollout> {
    let velocity = Vector3::new(p[1], 0.3, 0.0);
    let motion =
        BodyMotion { velocity, spin: Vector3::z(), ..BodyMotion::at(Vector3::z() * 0.0276) };
    let mut system = thrown(&CORNERS, 0.0, motion);
    let friction = ContactParameter::new(&system, 0..4, ContactQuantity::Friction);
    friction.set(&mut system, p[0].exp());
    let ahead = Initial { bodies: vec![0], freedom: Freedom::Velocity, axis: Vector3::x() };
    let mut recorder = Recorder::new(&system, vec![Box::new(friction), Box::new(ahead)]);
    for _ in 0..80 {
        system.step_recorded(1.0 / 120.0, &mut recorder).ok()?;
    }
    Some(recorder.finish())
}

/// Estimates friction and speed of a box from observed poses, with errors of 1 mm and 1 mrad. `noise` returns errors in these
/// units.
fn recover(truth: &Rollout, mut noise: impl FnMut() -> f64) -> Fit {
    const SEEN_EVERY: usize = 4;
    let errors: Vec<f64> = (0..5 * truth.steps()).map(|_| noise()).collect();
    let evaluate = |p: &[f64]| {
        let rollout = slide(p)?;
        let seen = |step: usize| {
            let target = truth.motions(step)[0];
            let axes = [Vector3::x(), Vector3::y()];
            let places = axes
                .map(|axis| Residual::position(&rollout, step, 0, &target.position, axis * 1e3));
            let turn = Residual::orientation(&rollout, step, 0, &target.rotation, 1e3);
            places.into_iter().chain(turn)
        };
        let residuals: Vec<_> = (1..=rollout.steps()).step_by(SEEN_EVERY).flat_map(seen).collect();
        let values = residuals.iter().zip(&errors).map(|(residual, error)| residual.value + error);
        let (values, coefficient) = (values.collect(), p[0].exp());
        let jacobian = move || {
            let mut jacobian = rollout.jacobian(&residuals);
            jacobian.column_mut(0).scale_mut(coefficient);
            jacobian
        };
        Some(Evaluation { values, jacobian: Box::new(jacobian) })
    };
    let options = Options { tolerance: 1e-14, most: 0.5, ..Options::default() };
    minimise(&[0.6_f64.ln(), 0.8], &[], &options, evaluate).unwrap()
}

/// Tests that estimates are exact without noise, and scatter by their standard deviations with noise.
#[test]
fn friction_is_recovered_from_how_a_box_slides() {
    let truth = [0.27_f64.ln(), 1.1];
    let seen = slide(&truth).unwrap();
    let exact = recover(&seen, || 0.0);
    for (found, truth) in exact.parameters.iter().zip(truth) {
        assert!((found - truth).abs() < 1e-6, "{exact:?}");
    }
    let mut rng = fastrand::Rng::with_seed(1);
    let mut normal = || (0..12).map(|_| rng.f64()).sum::<f64>() - 6.0;
    const DRAWS: usize = 40;
    let mut squares = [0.0; 2];
    for _ in 0..DRAWS {
        let fit = recover(&seen, &mut normal);
        let found = fit.parameters.iter().zip(truth).zip(fit.deviations());
        for (square, ((found, truth), deviation)) in squares.iter_mut().zip(found) {
            *square += ((found - truth) / deviation).powi(2) / DRAWS as f64;
        }
    }
    // Mean of 40 squares: 1 ± 0.22.
    assert!(squares.iter().all(|square| (0.5..1.7).contains(square)), "{squares:?}");
}

/// Tests that the friction of a sticking contact, and every parameter of an open contact, has no effect.
#[test]
fn health_says_what_has_no_effect_and_what_happens() {
    let motion =
        BodyMotion { velocity: Vector3::x() * 0.01, ..BodyMotion::at(Vector3::z() * 0.0276) };
    let mut points = CORNERS.to_vec();
    points.push(Vector3::z());
    let mut system = thrown(&points, 0.0, motion);
    for contact in 0..5 {
        system.force_mut::<GroundContact>(contact).unwrap().friction.model = FrictionModel::Linear;
    }
    let start = Initial { bodies: vec![0], freedom: Freedom::Position, axis: Vector3::x() };
    let parameters: Vec<Box<dyn Parameter>> = vec![
        Box::new(start),
        Box::new(ContactParameter::new(&system, 0..4, ContactQuantity::Friction)),
        Box::new(ContactParameter::new(&system, 0..4, ContactQuantity::Stick)),
        Box::new(ContactParameter::new(&system, [4], ContactQuantity::Stiffness)),
        Box::new(BodyMass { body: 0, of: MassQuantity::Mass }),
    ];
    let mut recorder = Recorder::new(&system, parameters);
    for _ in 0..30 {
        system.step_recorded(1.0 / 60.0, &mut recorder).unwrap();
    }
    let health = Health::of(&recorder.finish(), 0..1);
    assert_eq!(health.without_effect, [1, 3]);
    assert!(health.finite && health.vanishing.is_empty() && health.halved.is_empty());
    assert_eq!(health.size.len(), 31);
}

fn robot(name: &str) -> Robot {
    let path = format!("{}/../shipped/robots/{name}.toml", env!("CARGO_MANIFEST_DIR"));
    Robot::from_toml(name, &std::fs::read_to_string(path).unwrap()).unwrap()
}

const STEP_S: f64 = 1.0 / 60.0;
const STEPS: usize = 90;

/// Robot that crouches and sways, with a scale factor of the gains of its servos. Offsets of the targets are ordered by knot,
/// then joint.
struct Crouch {
    robot: Robot,
    gain: f64,
    curve: Arc<Curve>,
}

impl Crouch {
    fn run(&self, offsets: &[f64]) -> Option<Rollout> {
        self.by(offsets, |world| {
            let joints = &world.motors()[..self.robot.joints.len()];
            Control::of_all(joints, &vec![true; joints.len()], &self.curve)
        })
    }

    fn by(
        &self,
        offsets: &[f64],
        parameters: impl Fn(&World) -> Vec<Box<dyn Parameter>>,
    ) -> Option<Rollout> {
        let ground: Arc<dyn Ground> = Arc::new(Plane::level());
        let mut world = World::standing(&self.robot, &ground, &Parameters::new(&self.robot));
        let (motors, joints) = (world.motors().to_vec(), self.robot.joints.len());
        let parameters = parameters(&world);
        let system = world.system_mut();
        for &motor in &motors[..joints] {
            system.force_mut::<Motor>(motor).unwrap().law.kp_nm_rad *= self.gain;
        }
        let mut recorder = Recorder::new(system, parameters);
        for _ in 0..STEPS {
            let time_s = system.time_s() + STEP_S;
            let (sine, cosine) = (TAU * time_s).sin_cos();
            let channels = self.robot.channels().zip(&motors).enumerate();
            for (number, (channel, &motor)) in channels {
                let law = &mut system.force_mut::<Motor>(motor).unwrap().law;
                match channel {
                    Channel::Joint(joint) => {
                        let knots: Vec<_> =
                            offsets.chunks(joints).map(|knot| knot[number]).collect();
                        let [angle, speed] = self.curve.at(&knots, time_s);
                        let size = 0.02 * (1 + number % 4) as f64;
                        law.position_rad = joint.nominal_rad + size * (1.0 - cosine) + angle;
                        law.speed_rad_s = size * TAU * sine + speed;
                    }
                    Channel::Wheel(..) => law.speed_rad_s = 2.0 * (1.0 - cosine),
                }
            }
            system.step_recorded(STEP_S, &mut recorder).ok()?;
        }
        Some(recorder.finish())
    }
}

/// Tests a robot on its wheels and servos: a change of the initial position persists, a change of the initial velocity decays.
#[test]
fn derivatives_by_where_a_robot_began_do_not_grow() {
    let robot = robot("agilebot");
    let joints = robot.joints.len();
    let curve =
        Curve { begin_s: 0.0, spacing_s: 1.0, knots: 2, degree: Degree::Linear, periodic: false };
    let crouch = Crouch { robot, gain: 1.0, curve: Arc::new(curve) };
    let rollout = crouch.by(&vec![0.0; 2 * joints], |world| {
        let bodies: Vec<usize> = (0..world.system().bodies().len()).collect();
        let freedoms =
            [Freedom::Position, Freedom::Rotation, Freedom::Velocity, Freedom::Spin].into_iter();
        let of = |freedom| {
            let bodies = bodies.clone();
            [Vector3::x(), Vector3::y(), Vector3::z()].map(|axis| -> Box<dyn Parameter> {
                Box::new(Initial { bodies: bodies.clone(), freedom, axis })
            })
        };
        freedoms.flat_map(of).collect()
    });
    let health = Health::of(&rollout.unwrap(), 0..1);
    assert!(health.growth() < 2.0, "{:?}", health.size);
    let most = health.size.iter().copied().fold(0.0, f64::max);
    assert!(most < 2.0 * health.size[0], "{:?}", health.size);
    assert!(health.without_effect.is_empty() && health.finite, "{health:?}");
}

/// Tests the optimisation of targets for weak servos: the robot then moves as with strong servos.
#[test]
fn targets_make_up_for_weak_servos() {
    let robot = robot("agilebot");
    let curve = Arc::new(Curve {
        begin_s: 0.0,
        spacing_s: 0.25,
        knots: 7,
        degree: Degree::Cubic,
        periodic: false,
    });
    let parameters = robot.joints.len() * curve.knots;
    let strong = Crouch { robot: robot.clone(), gain: 1.0, curve: Arc::clone(&curve) };
    let weak = Crouch { robot, gain: 0.2, curve };
    let wanted = strong.run(&vec![0.0; parameters]).unwrap();
    let miss = |rollout: &Rollout| {
        let at = |step: usize| {
            let target = wanted.motions(step)[0];
            let axes = [Vector3::x(), Vector3::y(), Vector3::z()];
            let places = axes
                .map(|axis| Residual::position(rollout, step, 0, &target.position, axis * 30.0));
            let turn = Residual::orientation(rollout, step, 0, &target.rotation, 10.0);
            places.into_iter().chain(turn)
        };
        (1..=STEPS).flat_map(at).collect::<Vec<_>>()
    };
    let mut penalties = Penalty::smooth(16, 7, false, 1e-3);
    penalties.extend(Penalty::small(parameters, 1e-6));
    let options = Options { iterations: 6, ..Options::default() };
    let fit = minimise(&vec![0.0; parameters], &penalties, &options, |offsets| {
        let rollout = weak.run(offsets)?;
        let residuals = miss(&rollout);
        Some(Evaluation::from((rollout, residuals)))
    });
    let fit = fit.unwrap();
    let sags = |offsets: &[f64]| {
        let rollout = weak.run(offsets).unwrap();
        let off = |step: usize| {
            (rollout.motions(step)[0].position - wanted.motions(step)[0].position).norm()
        };
        (20..=STEPS).map(off).fold(0.0, f64::max)
    };
    let [before, after] = [vec![0.0; parameters], fit.parameters].map(|offsets| sags(&offsets));
    assert!(after < 0.05 * before, "{before}, {after}");
}

/// Tests the terms of objectives against central differences of rollouts.
#[test]
fn residuals_have_their_derivatives() {
    let robot = robot("agilebot");
    let ground: Arc<dyn Ground> = Arc::new(Plane::level());
    let mut parameters = Parameters::new(&robot);
    parameters.settings.tolerance = 1e-9;
    let start = [
        (Freedom::Rotation, Vector3::new(0.6, 0.0, 0.8)),
        (Freedom::Velocity, Vector3::y()),
        (Freedom::Spin, Vector3::new(0.0, 0.6, 0.8)),
    ]
    .map(|(freedom, axis)| Initial { bodies: (0..21).collect(), freedom, axis });
    let standing = || World::standing(&robot, &ground, &parameters);
    // Motors of a joint and of a wheel.
    let motors = {
        let world = standing();
        [2, 17].map(|n| world.system().force::<Motor>(world.motors()[n]).unwrap().clone())
    };
    let run = |by: Option<(usize, f64)>| {
        let mut world = standing();
        let system = world.system_mut();
        // A start with arbitrary rotation and velocity.
        start[1].vary(system, 0.3);
        start[2].vary(system, 1.5);
        if let Some((number, by)) = by {
            start[number].vary(system, by);
        }
        let all = start.iter().map(|start| -> Box<dyn Parameter> { Box::new(start.clone()) });
        let mut recorder = Recorder::new(system, all.collect());
        for _ in 0..6 {
            system.step_recorded(STEP_S, &mut recorder).unwrap();
        }
        let rollout = recorder.finish();
        let (at, axis) = (Vector3::new(0.1, -0.2, 0.3), Vector3::new(0.5, -0.4, 2.0));
        let target = nalgebra::Rotation3::new(Vector3::new(0.4, -0.3, 0.2)).into_inner();
        let mut residuals = vec![
            Residual::position(&rollout, 4, 3, &at, axis),
            Residual::velocity(&rollout, 6, 3, &at, axis),
            Residual::gyroscope(&rollout, 5, 0, &axis, 0.3, 2.0),
            Residual::com(&rollout, 5, &at, axis),
            Residual::mean_velocity(&rollout, [2, 6], &at, axis),
        ];
        residuals.extend(Residual::orientation(&rollout, 6, 3, &target, 3.0));
        for motor in &motors {
            residuals.push(Residual::angle(&rollout, 6, motor, 0.2, 2.0));
            residuals.push(Residual::speed(&rollout, 6, motor, 0.1, 2.0));
        }
        (rollout, residuals)
    };
    let (rollout, residuals) = run(None);
    let jacobian = rollout.jacobian(&residuals);
    for number in 0..start.len() {
        let step = 1e-6;
        let values = |by: f64| {
            let (_, residuals) = run(Some((number, by)));
            residuals.into_iter().map(|residual| residual.value).collect::<Vec<_>>()
        };
        let (ahead, behind) = (values(step), values(-step));
        for row in 0..residuals.len() {
            let rate = (ahead[row] - behind[row]) / (2.0 * step);
            let found = jacobian[(row, number)];
            assert!((rate - found).abs() < 1e-6 * (1.0 + found.abs()), "{row}: {found}, {rate}");
        }
    }
}
