//! Tests derivatives of whole rollouts against central differences, and the adjoint method against the direct one.

use nalgebra::{Matrix3, Rotation3, Vector3};
use rollwalk_multibody::ground::{Ground, Plane};
use rollwalk_physics::contact::{GroundContact, Normal, Resistance, Tip};
use rollwalk_physics::curve::{Curve, Degree};
use rollwalk_physics::friction::{Friction, FrictionModel};
use rollwalk_physics::motor::Motor;
use rollwalk_physics::sensitivity::parameter::{
    BodyMass, ContactParameter, ContactQuantity, Control, Freedom, Gravity, Initial, MassQuantity,
    MaterialQuantity, MotorParameter, MotorQuantity, Softness, Targets,
};
use rollwalk_physics::sensitivity::{Constant, Parameter, Recorder, Rollout, Variation};
use rollwalk_physics::soft::{Material, Mesh, SoftBody, SurfaceContact};
use rollwalk_physics::world::Parameters;
use rollwalk_physics::{
    Assembly, Body, BodyMotion, ContactChange, Inertia, Scheme, Settings, System, World,
};
use rollwalk_robot::{Channel, Robot, SoftMaterial};
use std::f64::consts::TAU;
use std::sync::Arc;

/// Function that changes a new scene by a given amount of a parameter.
type Change = Box<dyn Fn(&mut System, &mut Vec<f64>, f64)>;

/// Parameter, the function that changes it in a scene, and a small change of its value.
struct Case {
    name: String,
    parameter: Box<dyn Parameter>,
    change: Change,
    difference: f64,
}

/// Test case for a constant.
fn constant<C: Constant + Clone + 'static>(name: &str, constant: C, system: &System) -> Case {
    let value = constant.value(system);
    let changed = constant.clone();
    Case {
        name: name.into(),
        parameter: Box::new(constant),
        change: Box::new(move |system, _, by| {
            let value = changed.value(system);
            changed.set(system, value + by);
        }),
        difference: 1e-5 * value.abs().max(1e-2),
    }
}

fn initial(freedom: Freedom, bodies: &[usize], axis: Vector3<f64>) -> Case {
    let parameter = Initial { bodies: bodies.to_vec(), freedom, axis };
    let changed = parameter.clone();
    Case {
        name: format!("{freedom:?}"),
        parameter: Box::new(parameter),
        change: Box::new(move |system, _, by| changed.vary(system, by)),
        difference: 1e-6,
    }
}

impl Case {
    /// Multiplies the difference, for cases in which the solver's tolerance would dominate a smaller one.
    fn wider(self, times: f64) -> Self {
        Self { difference: times * self.difference, ..self }
    }
}

/// Simulated scene. `steer` acts before each step, with offsets of the controls.
struct Scene<'a> {
    build: &'a dyn Fn() -> System,
    steer: &'a dyn Fn(&mut System, &[f64]),
    controls: usize,
    step_s: f64,
    steps: usize,
    /// Accepted relative error of the differences.
    bound: f64,
}

impl Scene<'_> {
    fn motions(&self, change: &Change, by: f64) -> Vec<BodyMotion> {
        let mut system = (self.build)();
        let mut controls = vec![0.0; self.controls];
        change(&mut system, &mut controls, by);
        for _ in 0..self.steps {
            (self.steer)(&mut system, &controls);
            system.step(self.step_s).unwrap();
        }
        system.motions().to_vec()
    }

    fn record(&self, parameters: Vec<Box<dyn Parameter>>) -> Rollout {
        let mut system = (self.build)();
        let mut recorder = Recorder::new(&system, parameters);
        for _ in 0..self.steps {
            (self.steer)(&mut system, &vec![0.0; self.controls]);
            system.step_recorded(self.step_s, &mut recorder).unwrap();
        }
        recorder.finish()
    }

    /// Compares derivatives of the final motions with central differences, and both methods with each other.
    fn check(&self, cases: Vec<Case>) -> Rollout {
        let (changes, parameters): (Vec<_>, Vec<_>) = cases
            .into_iter()
            .map(|Case { name, parameter, change, difference }| {
                ((name, change, difference), parameter)
            })
            .unzip();
        let rollout = self.record(parameters);
        let mut found: Vec<Vec<Variation>> = Vec::new();
        rollout.direct(|step, tangents| {
            if step == rollout.steps() {
                let bodies = 0..rollout.motions(step).len();
                let of = |parameter| bodies.clone().map(|b| tangents.of(b, parameter)).collect();
                found = (0..tangents.parameters()).map(of).collect();
            }
        });
        for ((name, change, size), found) in changes.iter().zip(&found) {
            let ahead = self.motions(change, *size);
            let behind = self.motions(change, -*size);
            let (mut error, mut scale) = (0.0_f64, 0.0_f64);
            for (body, by) in found.iter().enumerate() {
                let difference = difference(&ahead[body], &behind[body], 2.0 * size);
                for (by, difference) in parts(by).iter().zip(parts(&difference)) {
                    error = error.max((by - difference).norm());
                    scale = scale.max(by.norm());
                }
            }
            println!("{name:28} {scale:9.3e} {:9.2e}", error / scale);
            assert!(scale > 0.0, "nothing depends on {name}");
            assert!(error < self.bound * scale, "{name}: {error:e} of {scale:e}");
        }
        agree(&rollout);
        rollout
    }
}

fn parts(of: &Variation) -> [Vector3<f64>; 4] {
    [of.shift, of.turn, of.velocity, of.spin]
}

fn difference(ahead: &BodyMotion, behind: &BodyMotion, over: f64) -> Variation {
    let turned = ahead.rotation * behind.rotation.transpose();
    let turn = Vector3::new(
        turned[(2, 1)] - turned[(1, 2)],
        turned[(0, 2)] - turned[(2, 0)],
        turned[(1, 0)] - turned[(0, 1)],
    );
    Variation {
        shift: (ahead.position - behind.position) / over,
        turn: turn * (0.5 / over),
        velocity: (ahead.velocity - behind.velocity) / over,
        spin: (ahead.spin - behind.spin) / over,
    }
}

/// Compares both methods for a scalar that depends on many motions at many steps.
fn agree(rollout: &Rollout) {
    let mut rng = fastrand::Rng::with_seed(1);
    let mut random = || Vector3::from_fn(|_, _| 2.0 * rng.f64() - 1.0);
    let bodies = rollout.motions(0).len();
    let mut number = Vec::new();
    for step in (0..=rollout.steps()).step_by(1 + rollout.steps() / 7).chain([rollout.steps()]) {
        for body in (0..bodies).step_by(1 + bodies / 5) {
            let [shift, turn, velocity, spin] = [(); 4].map(|()| random());
            number.push((step, body, Variation { shift, turn, velocity, spin }));
        }
    }
    let backward = rollout.adjoint(number.iter().map(|(step, body, by)| (*step, *body, by)));
    // Magnitudes of all summands.
    let mut sizes = vec![0.0; rollout.parameters()];
    let mut forward = vec![0.0; rollout.parameters()];
    rollout.direct(|at, tangents| {
        for (_, body, by) in number.iter().filter(|(step, ..)| *step == at) {
            tangents.add_to(*body, by, &mut forward);
            for (parameter, size) in sizes.iter_mut().enumerate() {
                *size += tangents.of(*body, parameter).dot(by).abs();
            }
        }
    });
    for (parameter, (one, other)) in forward.iter().zip(&backward).enumerate() {
        let error = (one - other).abs();
        assert!(error <= 1e-10 * sizes[parameter], "{parameter}: {one:e}, {other:e}");
    }
}

fn settings(scheme: Scheme) -> Settings {
    Settings { scheme, tolerance: 1e-11, ..Settings::default() }
}

fn no_steer(_: &mut System, _: &[f64]) {}

/// Box that is thrown onto an incline, where it bounces, tumbles and slides.
fn thrown_box(settings: Settings, model: FrictionModel) -> System {
    let about_com_kg_m2 = Matrix3::from_diagonal(&Vector3::new(1e-3, 2e-3, 2.5e-3));
    let mut assembly = Assembly::default();
    let motion = BodyMotion {
        position: Vector3::new(0.0, 0.0, 0.12),
        rotation: Rotation3::new(Vector3::new(0.1, 0.2, 0.3)).into_inner(),
        velocity: Vector3::new(0.6, 0.2, -0.3),
        spin: Vector3::new(1.0, -2.0, 3.0),
    };
    assembly.add_body(Inertia { mass_kg: 1.0, about_com_kg_m2 }, motion);
    let ground: Arc<dyn Ground> = Arc::new(Plane::rising(0.1));
    for corner in 0..8 {
        let side = |bit: u32, size: f64| size * (f64::from(corner >> bit & 1) * 2.0 - 1.0);
        assembly.add(GroundContact {
            body: [0],
            center: Vector3::new(side(0, 0.1), side(1, 0.06), side(2, 0.03)),
            radius_m: 0.0,
            tip: Tip::Sphere,
            normal: Normal { stiffness_n_m: 2e3, damping_n_s_m: 8.0, ramp_m: 3e-3, pulls: true },
            friction: Friction { model, coefficient: 0.4, stick_n_s_m: 30.0 },
            resistance: Resistance::default(),
            ground: Arc::clone(&ground),
        });
    }
    System::new(settings, assembly)
}

#[test]
fn a_thrown_box_has_the_derivatives_of_its_bounces() {
    for (scheme, model) in [
        (Scheme::Bdf1, FrictionModel::Linear),
        (Scheme::Bdf1, FrictionModel::Tanh),
        (Scheme::Bdf1, FrictionModel::Hybrid),
        (Scheme::Bdf2, FrictionModel::Linear),
        (Scheme::Bdf2, FrictionModel::Tanh),
    ] {
        let hybrid = model == FrictionModel::Hybrid;
        let build = || thrown_box(settings(scheme), model);
        let scene = Scene {
            build: &build,
            steer: &no_steer,
            controls: 0,
            step_s: 1.0 / 240.0,
            steps: 120,
            // Held corners share their load according to their stiffness, which is not a parameter.
            bound: if hybrid { 1e-3 } else { 1e-5 },
        };
        let system = build();
        let mut cases = vec![
            initial(Freedom::Position, &[0], Vector3::z()),
            initial(Freedom::Rotation, &[0], Vector3::new(0.6, 0.0, 0.8)),
            initial(Freedom::Velocity, &[0], Vector3::x()),
            initial(Freedom::Spin, &[0], Vector3::new(0.0, 0.8, 0.6)),
            constant("inertia", BodyMass { body: 0, of: MassQuantity::Inertia(1, 1) }, &system),
        ];
        use ContactQuantity::{Damping, Friction, Ramp, Stick, Stiffness};
        let touching = |of: ContactQuantity| {
            constant(&format!("{of:?}"), ContactParameter::new(&system, 0..8, of), &system)
        };
        cases.extend([touching(Ramp), touching(Friction)]);
        // The effect of these parameters is small in a held box.
        let mut little =
            vec![constant("mass", BodyMass { body: 0, of: MassQuantity::Mass }, &system)];
        little.extend([touching(Stiffness), touching(Damping)]);
        if !hybrid {
            little.push(touching(Stick));
        }
        println!("{scheme:?} {model:?}");
        let rollout = scene.check(cases);
        Scene { bound: if hybrid { 1e-2 } else { 1e-5 }, ..scene }.check(little);
        let events = rollout.reports().iter().flat_map(|report| &report.events);
        let slips = events.clone().filter(|event| event.change == ContactChange::SlipBegins);
        let touches =
            events.filter(|event| matches!(event.change, ContactChange::TouchDown { .. }));
        println!("{} touch-downs, {} slips", touches.count(), slips.count());
    }
}

/// Tests steps with few iterations, which are halved. With BDF2, the first substep is backward Euler.
#[test]
fn steps_that_were_halved_have_their_derivatives() {
    let few = Settings { iterations: 2, ..settings(Scheme::Bdf2) };
    let build = || thrown_box(few, FrictionModel::Tanh);
    let scene = Scene {
        build: &build,
        steer: &no_steer,
        controls: 0,
        step_s: 1.0 / 60.0,
        steps: 30,
        bound: 1e-5,
    };
    let system = build();
    let rollout = scene.check(vec![
        initial(Freedom::Rotation, &[0], Vector3::new(0.6, 0.0, 0.8)).wider(0.1),
        initial(Freedom::Velocity, &[0], Vector3::x()),
        constant("mu", ContactParameter::new(&system, 0..8, ContactQuantity::Friction), &system),
    ]);
    let halved = rollout.reports().iter().filter(|report| report.subdivisions > 0).count();
    println!("{halved} of 30 steps halved");
    assert!(halved >= 3, "{halved}");
}

/// Soft cube that falls and slides, with the force indices of its elements and contacts, and its nodes. The interior node has
/// no contact.
fn soft_cube() -> (System, std::ops::Range<usize>, std::ops::Range<usize>, Vec<usize>) {
    let mut assembly = Assembly::default();
    let mesh = Mesh::block(Vector3::z() * 0.01, Vector3::repeat(0.1), [2; 3]);
    let material = Material { viscosity_pa_s: 2.0, ..Material::elastic(150.0, 1e4, 0.3) };
    let soft = SoftBody::add(&mut assembly, &mesh, &material).unwrap();
    let elements = 0..assembly.forces.len();
    soft.launch(&mut assembly, Vector3::new(0.5, 0.1, -0.2), Vector3::new(0.0, 3.0, 1.0));
    let friction = Friction { model: FrictionModel::Tanh, coefficient: 0.4, stick_n_s_m: 500.0 };
    let contact =
        SurfaceContact { stiffness_n_m3: 1e5, damping_n_s_m3: 500.0, ramp_m: 1e-3, friction };
    let ground: Arc<dyn Ground> = Arc::new(Plane::level());
    let contacts = soft.touch(&mut assembly, &ground, &contact);
    let system = System::new(settings(Scheme::Bdf2), assembly);
    (system, elements, contacts, soft.nodes.collect())
}

#[test]
fn a_soft_cube_has_derivatives_by_its_material() {
    let build = || soft_cube().0;
    let scene = Scene {
        build: &build,
        steer: &no_steer,
        controls: 0,
        step_s: 1.0 / 200.0,
        steps: 40,
        bound: 1e-5,
    };
    let (system, elements, contacts, nodes) = soft_cube();
    let mut cases = vec![
        initial(Freedom::Position, &nodes, Vector3::z()),
        initial(Freedom::Velocity, &nodes, Vector3::x()),
        initial(Freedom::Spin, &nodes, Vector3::y()),
    ];
    use MaterialQuantity::{Density, Lambda, Mu, Viscosity};
    for of in [Mu, Lambda, Viscosity, Density] {
        let softness = Softness { elements: elements.clone(), of };
        cases.push(constant(&format!("{of:?}"), softness, &system));
    }
    for of in [ContactQuantity::Stiffness, ContactQuantity::Friction] {
        let touching = ContactParameter::new(&system, contacts.clone(), of);
        cases.push(constant(&format!("{of:?}"), touching, &system));
    }
    scene.check(cases);
}

fn robot(name: &str) -> Robot {
    let path = format!("{}/../shipped/robots/{name}.toml", env!("CARGO_MANIFEST_DIR"));
    Robot::from_toml(name, &std::fs::read_to_string(path).unwrap()).unwrap()
}

/// Tests a robot that swings its joints and drives its wheels, with a fifth of the drives' gains.
#[test]
fn agilebot_has_derivatives_by_its_targets_gains_and_ground() {
    for scheme in [Scheme::Bdf1, Scheme::Bdf2] {
        moving_robot("agilebot", scheme, None, 1e-5);
    }
}

#[test]
fn swizzlebot_has_derivatives_by_its_targets_gains_and_ground() {
    moving_robot("swizzlebot", Scheme::Bdf1, None, 1e-5);
}

/// Tests SkaterBot on blades. The effect of spin is small, and only slightly larger than the error from the solver's tolerance.
#[test]
fn skaterbot_has_derivatives_by_its_targets_gains_and_ground() {
    moving_robot("skaterbot", Scheme::Bdf2, None, 3e-4);
}

#[test]
#[ignore = "minutes: cargo xtask nightly --only long"]
fn legbot_on_soft_feet_has_derivatives() {
    let material =
        SoftMaterial { young_pa: 2e5, poisson: 0.3, density_kg_m3: 100.0, viscosity_pa_s: 5.0 };
    moving_robot("legbot", Scheme::Bdf1, Some(material), 1e-5);
}

/// Amplitude of a joint's swing, rad, chosen so that legs lift one after another.
fn swing_rad(joint: usize) -> f64 {
    0.04 + 0.02 * (joint % 4) as f64
}

fn moving_robot(name: &str, scheme: Scheme, soft: Option<SoftMaterial>, bound: f64) {
    let mut robot = robot(name);
    robot.end_effectors.iter_mut().for_each(|foot| foot.soft = soft);
    let world = || {
        let mut parameters = Parameters::new(&robot);
        parameters.settings = settings(scheme);
        parameters.settings.tolerance = 1e-9;
        let ground: Arc<dyn Ground> = Arc::new(Plane::level());
        let mut world = World::standing(&robot, &ground, &parameters);
        for motor in world.motors().to_vec() {
            let law = &mut world.system_mut().force_mut::<Motor>(motor).unwrap().law;
            law.kp_nm_rad *= 0.2;
            law.speed_rad_s = 0.0;
        }
        world
    };
    let (step_s, steps) = (1.0 / 60.0, 40);
    let curve = Arc::new(Curve {
        begin_s: 0.0,
        spacing_s: 0.2,
        knots: 4,
        degree: Degree::Cubic,
        periodic: false,
    });
    let motors = world().motors().to_vec();
    let joints = robot.joints.len();
    let nominal: Vec<Option<f64>> = (robot.channels())
        .map(|channel| match channel {
            Channel::Joint(joint) => Some(joint.nominal_rad),
            Channel::Wheel(..) => None,
        })
        .collect();
    let steer = |system: &mut System, controls: &[f64]| {
        let time_s = system.time_s() + step_s;
        let (&delay_s, controls) = controls.split_first().unwrap();
        let (sine, cosine) = (TAU * (time_s - delay_s)).sin_cos();
        let (_, steady) = (TAU * time_s).sin_cos();
        for (number, (&motor, nominal)) in motors.iter().zip(&nominal).enumerate() {
            let law = &mut system.force_mut::<Motor>(motor).unwrap().law;
            match nominal {
                Some(nominal) => {
                    let of_motor = controls.chunks(joints).map(|knot| knot[number]);
                    let [angle, speed] = curve.at(&of_motor.collect::<Vec<_>>(), time_s);
                    let size = swing_rad(number);
                    law.position_rad = nominal + size * (1.0 - cosine) + angle;
                    law.speed_rad_s = size * TAU * sine + speed;
                }
                None => law.speed_rad_s = 4.0 * (1.0 - steady),
            }
        }
    };
    let build = || {
        let mut world = world();
        std::mem::replace(world.system_mut(), System::new(settings(scheme), Assembly::default()))
    };
    let scene = Scene {
        build: &build,
        steer: &steer,
        controls: 1 + joints * curve.knots,
        step_s,
        steps,
        bound,
    };
    let world = world();
    let system = build();
    let all: Vec<usize> = (0..system.bodies().len()).collect();
    let mut cases = vec![
        initial(Freedom::Position, &all, Vector3::z()),
        initial(Freedom::Rotation, &all, Vector3::y()),
        initial(Freedom::Velocity, &all, Vector3::x()),
        initial(Freedom::Spin, &all, Vector3::z()).wider(10.0),
        constant("mass of the body", BodyMass { body: 0, of: MassQuantity::Mass }, &system),
        constant(
            "inertia of the body",
            BodyMass { body: 0, of: MassQuantity::Inertia(1, 1) },
            &system,
        )
        .wider(30.0),
    ];
    let of_motors = [
        (MotorQuantity::PositionGain, 1.0),
        (MotorQuantity::SpeedGain, 1.0),
        (MotorQuantity::Armature, 10.0),
    ];
    for (of, wider) in of_motors {
        let drive = MotorParameter { motors: motors[..1].to_vec(), of };
        cases.push(constant(&format!("{of:?}"), drive, &system).wider(wider));
    }
    let contacts: Vec<usize> =
        (0..robot.end_effectors.len()).flat_map(|number| world.contacts(number)).collect();
    let mut numbers =
        vec![ContactQuantity::Stiffness, ContactQuantity::Damping, ContactQuantity::Stick];
    numbers.extend((motors.len() > joints).then_some(ContactQuantity::Resistance));
    for of in numbers {
        let touching = ContactParameter::new(&system, contacts.clone(), of);
        cases.push(constant(&format!("{of:?}"), touching, &system));
    }
    cases.push(constant("tilt", Gravity { axis: Vector3::x() }, &system).wider(10.0));
    // All joints are a little late; controls act at the end of a step.
    let late = {
        let motors = motors[..joints].to_vec();
        let by = move |number: usize, time_s: f64| {
            let (sine, cosine) = (TAU * time_s).sin_cos();
            [sine, TAU * cosine, 0.0].map(|rate| -swing_rad(number) * TAU * rate)
        };
        Targets { motors, by: Arc::new(by) }
    };
    cases.push(Case {
        name: "delay".into(),
        parameter: Box::new(late),
        change: Box::new(|_, controls, by| controls[0] += by),
        difference: 1e-6,
    });
    let targets = Control::of_all(&motors[..joints], &vec![true; joints], &curve);
    for (number, parameter) in targets.into_iter().enumerate().step_by(7) {
        let change: Change = Box::new(move |_, controls, by| controls[1 + number] += by);
        cases.push(Case { name: format!("target {number}"), parameter, change, difference: 4e-6 });
    }
    println!("{name} {scheme:?}");
    scene.check(cases);
}

/// Tests derivatives for a particle and a box on an incline, which hybrid friction either holds or releases.
#[test]
fn what_hybrid_friction_holds_is_held_in_derivatives_too() {
    for (angle_rad, scheme) in [(0.3, Scheme::Bdf1), (0.3, Scheme::Bdf2), (0.6, Scheme::Bdf1)] {
        let build = || {
            let ground = Plane::rising(angle_rad);
            let load = 9.81 * angle_rad.cos();
            let contact = |body: usize, center: Vector3<f64>| GroundContact {
                body: [body],
                center,
                radius_m: 0.0,
                tip: Tip::Sphere,
                normal: Normal {
                    stiffness_n_m: 5e3,
                    damping_n_s_m: 8.0,
                    ramp_m: 3e-4,
                    pulls: true,
                },
                friction: Friction {
                    model: FrictionModel::Hybrid,
                    coefficient: 0.5,
                    stick_n_s_m: 50.0,
                },
                resistance: Resistance::default(),
                ground: Arc::new(ground),
            };
            let mut assembly = Assembly::default();
            let particle = Body::Particle { mass_kg: 1.0 };
            let place = ground.normal * (-load / 5e3);
            // Thrown upwards, the particle slides, stops and stays.
            let velocity = Vector3::new(angle_rad.cos(), 0.0, angle_rad.sin()) * 0.7;
            assembly.add_body(particle, BodyMotion { velocity, ..BodyMotion::at(place) });
            assembly.add(contact(0, Vector3::zeros()));
            let about_com_kg_m2 = Matrix3::from_diagonal(&Vector3::new(1e-3, 2e-3, 2.5e-3));
            let turn = Rotation3::from_axis_angle(&Vector3::y_axis(), -angle_rad).into_inner();
            let motion = BodyMotion {
                rotation: turn,
                velocity: velocity * 0.3,
                ..BodyMotion::at(Vector3::y() + ground.normal * (0.03 - load / 2e4))
            };
            assembly.add_body(Inertia { mass_kg: 1.0, about_com_kg_m2 }, motion);
            for (x, y) in [(0.1, 0.06), (0.1, -0.06), (-0.1, 0.06), (-0.1, -0.06)] {
                assembly.add(contact(1, Vector3::new(x, y, -0.03)));
            }
            System::new(settings(scheme), assembly)
        };
        let scene = Scene {
            build: &build,
            steer: &no_steer,
            controls: 0,
            step_s: 1.0 / 120.0,
            steps: 60,
            bound: 1e-5,
        };
        let system = build();
        let along = Vector3::new(angle_rad.cos(), 0.0, angle_rad.sin());
        println!("{angle_rad} {scheme:?}");
        scene.check(vec![
            initial(Freedom::Position, &[0], along),
            initial(Freedom::Velocity, &[0], along),
            constant(
                "mu 0",
                ContactParameter::new(&system, [0], ContactQuantity::Friction),
                &system,
            ),
        ]);
        // The contacts that hold a rigid body are not unique, and neither is their stiffness.
        let rigid = Scene { bound: 1e-3, ..scene };
        let friction = ContactParameter::new(&system, 1..5, ContactQuantity::Friction);
        rigid.check(vec![
            initial(Freedom::Velocity, &[1], along).wider(100.0),
            constant("mu 1", friction, &system).wider(100.0),
        ]);
    }
}
