//! Tests of all kinds of parameters against differences of the residual, at random states.

use super::*;
use crate::anchor::Anchor;
use crate::assembly::Assembly;
use crate::body::Inertia;
use crate::check::LAW;
use crate::contact::{GroundContact, Normal, Resistance, Tip};
use crate::curve::{Curve, Degree};
use crate::friction::{Friction, FrictionModel};
use crate::hold::{Hold, HoldGains, TargetPose};
use crate::joint::{Ball, ParallelAxes};
use crate::motion::{Scheme, Weights};
use crate::motor::{Law, Motor};
use crate::points::Points;
use crate::residual::{Derive, Equations};
use crate::rotation::Increment;
use crate::soft::{Material, Mesh, SoftBody, SurfaceContact};
use crate::spring::Spring;
use crate::system::Settings;
use fastrand::Rng;
use nalgebra::{Matrix3, Vector3};
use rollwalk_multibody::ground::{Ground, Plane};
use std::sync::Arc;

const FRICTION: Friction =
    Friction { model: FrictionModel::Tanh, coefficient: 0.5, stick_n_s_m: 20.0 };

/// Scene near the ground: a foot that carries a wheel with a motor, springs from the wheel to the foot and to a bolt, a skate,
/// and a soft block.
struct Scene {
    system: System,
    motor: usize,
    contacts: [usize; 3],
    /// Force indices of a spring, a ball joint, parallel axes and an anchor.
    springs: [usize; 4],
    hold: usize,
    elements: std::ops::Range<usize>,
    nodes: std::ops::Range<usize>,
    surface: std::ops::Range<usize>,
}

fn scene(model: FrictionModel, law: Law) -> Scene {
    let ground: Arc<dyn Ground> = Arc::new(Plane::rising(0.1));
    let mut assembly = Assembly::default();
    let about_com_kg_m2 = Matrix3::new(0.02, 0.001, 0.0, 0.001, 0.03, 0.002, 0.0, 0.002, 0.04);
    let inertia = Inertia { mass_kg: 2.0, about_com_kg_m2 };
    let axis = Vector3::y();
    let tips = [Tip::Sphere, Tip::Rim { axis }, Tip::Blade { axis }];
    let contacts = [0, 1, 2].map(|body| {
        let place = Vector3::new(body as f64, 0.0, 0.1 * (1.0 + body as f64));
        assembly.add_body(inertia, BodyMotion::at(place));
        assembly.add(GroundContact {
            body: [body],
            center: Vector3::new(0.0, 0.01, -0.02),
            radius_m: 0.09,
            tip: tips[body],
            normal: Normal { stiffness_n_m: 500.0, damping_n_s_m: 3.0, ramp_m: 0.02, pulls: true },
            friction: Friction { model, ..FRICTION },
            resistance: Resistance { constant: 0.02, per_speed_s_m: 0.05 },
            ground: Arc::clone(&ground),
        })
    });
    let motor = assembly.add(Motor {
        bodies: [0, 1],
        axis,
        across: [Vector3::x(); 2],
        slide: None,
        armature_kg_m2: 0.02,
        stops: None,
        spring: None,
        angle_rad: 0.0,
        law,
    });
    let points = [Vector3::new(0.3, 0.0, 0.1), Vector3::new(-0.2, 0.05, 0.0)];
    let ends = Points { bodies: [0, 1], points };
    let (stiffness_n_m, damping_n_s_m) = (50.0, 3.0);
    let spring =
        Spring { ends: ends.clone(), rest_m: 0.2, stiffness_n_m, damping_n_s_m, string: false };
    let axes = [axis, Vector3::new(0.1, 1.0, 0.2).normalize()];
    let parallel = ParallelAxes {
        bodies: [0, 1],
        axes,
        stiffness_nm_rad: stiffness_n_m,
        damping_nm_s_rad: damping_n_s_m,
    };
    let [point, place] = points;
    let springs = [
        assembly.add(spring),
        assembly.add(Ball { ends, stiffness_n_m, damping_n_s_m }),
        assembly.add(parallel),
        assembly.add(Anchor { body: [2], point, place, stiffness_n_m, damping_n_s_m }),
    ];
    let place = TargetPose { position: Vector3::x() * 2.1, rotation: Matrix3::identity() };
    let grip =
        HoldGains { shift_n_m: 40.0, velocity_n_s_m: 3.0, turn_nm_rad: 5.0, spin_nm_s_rad: 0.7 };
    let hold = assembly.add(Hold { body: [2], grip, place: Some(place) });
    let mesh = Mesh::block(Vector3::new(3.0, 0.0, 0.3), Vector3::repeat(0.1), [1; 3]);
    let material = Material { viscosity_pa_s: 5.0, ..Material::elastic(100.0, 1e4, 0.3) };
    let first = assembly.forces.len();
    let soft = SoftBody::add(&mut assembly, &mesh, &material).unwrap();
    let elements = first..assembly.forces.len();
    let of_area = SurfaceContact {
        stiffness_n_m3: 1e4,
        damping_n_s_m3: 50.0,
        ramp_m: 0.02,
        friction: Friction { stick_n_s_m: 500.0, model, ..FRICTION },
    };
    let surface = soft.touch(&mut assembly, &ground, &of_area);
    let settings = Settings { scheme: Scheme::Bdf2, ..Settings::default() };
    let system = System::new(settings, assembly);
    Scene { system, motor, contacts, springs, hold, elements, nodes: soft.nodes, surface }
}

/// Moves bodies randomly near their initial positions, with random velocities, so that most touch the ground.
fn randomise(system: &mut System, places: &[BodyMotion], rng: &mut Rng) {
    let mut random = |size: f64| Vector3::from_fn(|_, _| size * (2.0 * rng.f64() - 1.0));
    let stirred = places.iter().map(|motion| BodyMotion {
        position: motion.position
            + random(0.02)
            + Vector3::z() * (motion.position.x * 0.1 - motion.position.z + 0.08),
        rotation: Increment::new(random(0.3)).rotation(),
        velocity: random(1.0),
        spin: random(2.0),
    });
    let mut stirred: Vec<BodyMotion> = stirred.collect();
    // The soft block keeps its shape.
    for (motion, place) in stirred.iter_mut().zip(places).skip(3) {
        motion.position = place.position + random(0.01) + Vector3::z() * 0.02;
    }
    system.restart(stirred);
}

/// Residual of a step at a trial.
fn residual(system: &System, trial: &[Displacement]) -> Vec<f64> {
    let weights = Weights::new(Scheme::Bdf2, 0.01);
    let step = system.next_step(&weights);
    let mut equations = Equations::new(step.bodies, step.forces);
    equations.begin(&step);
    equations.evaluate(&step, trial, &[], &[], Derive::Nothing);
    equations.residual
}

fn column(system: &System, trial: &[Displacement], parameter: &dyn Parameter) -> Vec<f64> {
    let weights = Weights::new(Scheme::Bdf2, 0.01);
    let step = system.next_step(&weights);
    let mut equations = Equations::new(step.bodies, step.forces);
    equations.begin(&step);
    equations.evaluate(&step, trial, &[], &[], Derive::Nothing);
    let solved = SolvedStep { step: &step, motions: &equations.motions, held: &[], time_s: 0.3 };
    let mut column = Column::new(equations.firsts.clone());
    parameter.residual(&solved, &mut column);
    let mut all = vec![0.0; equations.residual.len()];
    column.take().into_iter().for_each(|(row, value)| all[row] = value);
    all
}

/// Compares derivatives with differences at random states. Returns true if any derivative was nonzero.
fn agrees(
    system: &mut System,
    parameter: &dyn Parameter,
    size: f64,
    change: impl Fn(&mut System, f64),
) -> bool {
    let places = system.motions().to_vec();
    let mut moves = false;
    for seed in 0..12 {
        let mut rng = Rng::with_seed(seed);
        randomise(system, &places, &mut rng);
        let mut random = |size: f64| Vector3::from_fn(|_, _| size * (2.0 * rng.f64() - 1.0));
        let trial: Vec<_> = places
            .iter()
            .map(|_| Displacement { shift: random(0.005), turn: random(0.02) })
            .collect();
        let found = column(system, &trial, parameter);
        let step = 1e-6 * size;
        change(system, step);
        let ahead = residual(system, &trial);
        change(system, -2.0 * step);
        let behind = residual(system, &trial);
        change(system, step);
        let scale = found.iter().map(|part| part.abs()).fold(1.0 / size, f64::max);
        for (row, part) in found.iter().enumerate() {
            let rate = (ahead[row] - behind[row]) / (2.0 * step);
            let error = (rate - part).abs();
            assert!(error < 2e-6 * scale, "{parameter:?}, {seed}, row {row}: {part}, {rate}");
        }
        moves |= found.iter().any(|part| *part != 0.0);
    }
    system.restart(places);
    moves
}

#[test]
fn every_constant_is_the_derivative_of_the_residual() {
    for model in [FrictionModel::Linear, FrictionModel::Tanh] {
        let Scene { mut system, motor, contacts, springs, elements, nodes, surface, .. } =
            scene(model, LAW);
        let mut all: Vec<Box<dyn Constant>> = Vec::new();
        for of in [MassQuantity::Mass, MassQuantity::Inertia(0, 0), MassQuantity::Inertia(0, 2)] {
            all.push(Box::new(BodyMass { body: 1, of }));
        }
        all.push(Box::new(BodyMass { body: nodes.start, of: MassQuantity::Mass }));
        use MotorQuantity::{Armature, PositionGain, SpeedGain, Torque};
        for of in [PositionGain, SpeedGain, Torque, Armature] {
            all.push(Box::new(MotorParameter { motors: vec![motor], of }));
        }
        use MaterialQuantity::{Density, Lambda, Mu, Viscosity};
        for of in [Mu, Lambda, Viscosity, Density] {
            all.push(Box::new(Softness { elements: elements.clone(), of }));
        }
        for of in [SpringQuantity::Stiffness, SpringQuantity::Damping] {
            let [spring, ball, axes, anchor] = springs.map(|force| [force]);
            all.push(Box::new(Elastic::<Spring>::new(spring, of)));
            all.push(Box::new(Elastic::<Ball>::new(ball, of)));
            all.push(Box::new(Elastic::<ParallelAxes>::new(axes, of)));
            all.push(Box::new(Elastic::<Anchor>::new(anchor, of)));
        }
        all.push(Box::new(Gravity { axis: Vector3::new(0.6, 0.0, 0.8) }));
        use ContactQuantity::{
            Damping, Friction, Ramp, Resistance, ResistancePerSpeed, Stick, Stiffness,
        };
        let of_all = contacts.into_iter().chain(surface);
        for of in [Stiffness, Damping, Ramp, Friction, Stick] {
            all.push(Box::new(ContactParameter::new(&system, of_all.clone(), of)));
        }
        for (of, contact) in [Resistance, ResistancePerSpeed]
            .into_iter()
            .flat_map(|of| [(of, contacts[1]), (of, contacts[2])])
        {
            all.push(Box::new(ContactParameter::new(&system, [contact], of)));
        }
        for constant in &all {
            let value = constant.value(&system);
            let size = value.abs().max(1e-3);
            let change = |system: &mut System, by: f64| {
                let value = constant.value(system);
                constant.set(system, value + by);
            };
            let parameter: &dyn Parameter = constant.as_ref();
            assert!(agrees(&mut system, parameter, size, change), "{constant:?} does nothing");
            assert!((constant.value(&system) - value).abs() < 1e-9 * size);
        }
    }
}

#[test]
fn places_of_handles_and_moved_targets_are_derivatives_of_the_residual() {
    let Scene { mut system, motor, springs: [.., anchor], .. } = scene(FrictionModel::Tanh, LAW);
    let curve =
        Curve { begin_s: 0.0, spacing_s: 0.1, knots: 6, degree: Degree::Linear, periodic: false };
    let axis = Vector3::new(0.6, 0.0, 0.8);
    for (knot, near) in [(3, true), (1, false)] {
        let handle = Handle { anchor, axis, curve: Arc::new(curve), knot };
        let [shift, _] = curve.of_knot(knot, 0.3);
        let change = |system: &mut System, by: f64| {
            system.force_mut::<Anchor>(anchor).unwrap().place += axis * (shift * by);
        };
        assert_eq!(agrees(&mut system, &handle, 1.0, change), near);
    }
    let by = Arc::new(|_: usize, time_s: f64| [-2.0 * time_s, 5.0, 0.7]);
    let targets = Targets { motors: vec![motor], by };
    let change = |system: &mut System, by: f64| {
        let law = &mut system.force_mut::<Motor>(motor).unwrap().law;
        law.position_rad -= 2.0 * 0.3 * by;
        law.speed_rad_s += 5.0 * by;
        law.torque_nm += 0.7 * by;
    };
    assert!(agrees(&mut system, &targets, 1.0, change));
}

#[test]
fn poses_of_holds_are_derivatives_of_the_residual() {
    let Scene { mut system, hold, .. } = scene(FrictionModel::Tanh, LAW);
    let curve =
        Curve { begin_s: 0.0, spacing_s: 0.1, knots: 6, degree: Degree::Cubic, periodic: false };
    let curve = Arc::new(curve);
    let poses = (0..curve.knots).flat_map(|knot| Pose::of_knot(hold, &curve, knot));
    for (number, pose) in poses.enumerate() {
        let [share, _] = curve.of_knot(number / 6, 0.3);
        let change = |system: &mut System, by: f64| {
            // A large rotation, as of a gripper, because no other change moves this pose.
            static MOVED: std::sync::Mutex<f64> = std::sync::Mutex::new(0.0);
            let mut moved = MOVED.lock().unwrap();
            *moved += by;
            let mut position = Vector3::x() * 2.1;
            let mut turn = Vector3::new(2.8, -0.6, 1.1);
            match number % 6 {
                axis @ 0..3 => position[axis] += share * *moved,
                axis => turn[axis - 3] += share * *moved,
            }
            system.force_mut::<Hold>(hold).unwrap().place = Some(TargetPose::new(position, &turn));
        };
        change(&mut system, 0.0);
        assert_eq!(agrees(&mut system, pose.as_ref(), 1.0, change), share != 0.0, "{pose:?}");
    }
}

#[test]
fn controls_are_derivatives_of_the_residual_and_nothing_at_a_motors_limit() {
    let curve =
        Curve { begin_s: 0.0, spacing_s: 0.1, knots: 6, degree: Degree::Cubic, periodic: false };
    for (limit_nm, takes_speed, free) in
        [(1e3, true, true), (1e3, false, true), (1e-3, true, false)]
    {
        let Scene { mut system, motor, .. } = scene(FrictionModel::Tanh, Law { limit_nm, ..LAW });
        for knot in [2, 4, 5] {
            let control = Control { motor, curve: Arc::new(curve), knot, takes_speed };
            let [angle, speed] = curve.of_knot(knot, 0.3);
            let change = |system: &mut System, by: f64| {
                let law = &mut system.force_mut::<Motor>(motor).unwrap().law;
                law.position_rad += angle * by;
                if takes_speed {
                    law.speed_rad_s += speed * by;
                }
            };
            let moves = agrees(&mut system, &control, 1.0, change);
            assert_eq!(moves, free && knot != 5, "{knot}");
        }
    }
}
