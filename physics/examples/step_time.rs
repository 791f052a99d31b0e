//! CPU time of a step for robots, a robot with soft feet, chains of bodies, and a soft block.
//!
//! `cargo run --release -p rollwalk-physics --example step_time [NAME [TIMES]]`: NAME selects the systems whose name begins
//! with it; the default is all systems. TIMES multiplies the number of steps, so that a profiler gets enough samples.

use cpu_time::ProcessTime;
use nalgebra::{Matrix3, Vector3};
use rollwalk_multibody::ground::{Ground, Plane};
use rollwalk_physics::contact::{GroundContact, Normal, Resistance, Tip};
use rollwalk_physics::friction::{Friction, FrictionModel};
use rollwalk_physics::joint::Ball;
use rollwalk_physics::motor::Law;
use rollwalk_physics::points::Points;
use rollwalk_physics::soft::{Material, Mesh, SoftBody, SurfaceContact};
use rollwalk_physics::world::Parameters;
use rollwalk_physics::{
    Assembly, BodyMotion, Inertia, Settings, StepError, StepReport, System, World,
};
use rollwalk_robot::{Channel, Robot, SoftMaterial};
use std::sync::Arc;

const FRICTION: Friction =
    Friction { model: FrictionModel::Linear, coefficient: 0.5, stick_n_s_m: 20.0 };

fn level() -> Arc<dyn Ground> {
    Arc::new(Plane::level())
}

/// Takes steps and prints their CPU time.
fn measure(
    name: &str,
    step_s: f64,
    steps: u32,
    mut step: impl FnMut() -> Result<StepReport, StepError>,
) {
    let mut args = std::env::args().skip(1);
    if args.next().is_some_and(|wanted| !name.starts_with(&wanted)) {
        return;
    }
    let times = args.next().map_or(1, |times| times.parse().expect("TIMES is a number"));
    let steps = steps * times;
    let (mut iterations, mut worst, mut subdivisions) = (0, 0, 0);
    let start = ProcessTime::now();
    for _ in 0..steps {
        match step() {
            Ok(report) => {
                iterations += report.iterations;
                worst = worst.max(report.iterations);
                subdivisions += report.subdivisions;
            }
            Err(error) => return println!("{name:44} {error}"),
        }
    }
    let each_s = start.elapsed().as_secs_f64() / f64::from(steps);
    println!(
        "{name:44} {:8.3} ms/step {:8.1} x real time {:6.2} iterations/step, at most {worst}, {subdivisions} halvings",
        1e3 * each_s,
        step_s / each_s,
        f64::from(iterations) / f64::from(steps),
    );
}

fn robot(name: &str) -> Robot {
    let path = format!("{}/../shipped/robots/{name}.toml", env!("CARGO_MANIFEST_DIR"));
    let text = std::fs::read_to_string(&path).expect("the robot files are beside this crate");
    Robot::from_toml(name, &text).expect("shipped robot files are sound")
}

/// Measures a robot that swings its joints and drives its wheels.
fn moving(robot: &Robot, parameters: &Parameters, name: &str, step_s: f64, steps: u32) {
    let mut world = World::standing(robot, &level(), parameters);
    let mut time_s = 0.0;
    measure(name, step_s, steps, || {
        time_s += step_s;
        let (sine, cosine) = (std::f64::consts::TAU * time_s).sin_cos();
        for (number, channel) in robot.channels().enumerate() {
            let mut law = Law::servo(channel.actuator());
            match channel {
                Channel::Joint(joint) => {
                    law.position_rad = joint.nominal_rad + 0.03 * (1.0 - cosine);
                    law.speed_rad_s = 0.03 * std::f64::consts::TAU * sine;
                }
                Channel::Wheel(..) => law.speed_rad_s = 3.0 * (1.0 - cosine),
            }
            world.set_law(number, law);
        }
        world.step(step_s)
    });
}

/// Measures a row of boxes on the ground. Each box is attached to the next at two points.
fn chain(count: usize) {
    let mut assembly = Assembly::default();
    let about_com_kg_m2 = Matrix3::identity() * (0.1 * 0.1 * 0.1 / 6.0);
    for k in 0..count {
        let place = Vector3::new(0.12 * k as f64, 0.0, 0.0498);
        let inertia = Inertia { mass_kg: 0.1, about_com_kg_m2 };
        let motion = BodyMotion { velocity: Vector3::y(), ..BodyMotion::at(place) };
        let body = assembly.add_body(inertia, motion);
        for corner in 0..4 {
            let side = |bit: u32| 0.05 * (f64::from(corner >> bit & 1) * 2.0 - 1.0);
            assembly.add(GroundContact {
                body: [body],
                center: Vector3::new(side(0), side(1), -0.05),
                radius_m: 0.0,
                tip: Tip::Sphere,
                normal: Normal {
                    stiffness_n_m: 1e3,
                    damping_n_s_m: 1e-3,
                    ramp_m: 1e-4,
                    pulls: true,
                },
                friction: FRICTION,
                resistance: Resistance::default(),
                ground: level(),
            });
        }
        for side in [-0.05, 0.05].into_iter().filter(|_| k > 0) {
            let place = Vector3::new(0.12 * k as f64 - 0.06, side, 0.05);
            let ends = Points::at([body - 1, body], &assembly.motions, &place);
            assembly.add(Ball { ends, stiffness_n_m: 1e3, damping_n_s_m: 0.0 });
        }
    }
    let mut system = System::new(Settings::default(), assembly);
    let step_s = 1.0 / 500.0;
    let name = format!("chain of {count} boxes, 1/500 s");
    measure(&name, step_s, 500, || system.step(step_s));
}

fn block() {
    let mut assembly = Assembly::default();
    let mesh = Mesh::block(Vector3::z() * 1e-3, Vector3::new(0.12, 0.12, 0.08), [6, 6, 4]);
    let material = Material { viscosity_pa_s: 5.0, ..Material::elastic(150.0, 2.1e4, 0.045) };
    let soft = SoftBody::add(&mut assembly, &mesh, &material).expect("a block is sound");
    let contact = SurfaceContact {
        stiffness_n_m3: 1e6,
        damping_n_s_m3: 1e3,
        ramp_m: 1e-4,
        friction: FRICTION,
    };
    soft.touch(&mut assembly, &level(), &contact);
    let mut system = System::new(Settings::default(), assembly);
    measure("soft block of 864 elements, 5 ms", 5e-3, 60, || system.step(5e-3));
}

fn main() {
    let agilebot = robot("agilebot");
    let parameters = Parameters::new(&agilebot);
    moving(&agilebot, &parameters, "AgileBot, 1/60 s", 1.0 / 60.0, 240);
    moving(&agilebot, &parameters, "AgileBot, 1/240 s", 1.0 / 240.0, 960);
    let mut legbot = robot("legbot");
    let rigid = Parameters::new(&legbot);
    moving(&legbot, &rigid, "LegBot, 1/60 s", 1.0 / 60.0, 144);
    let material =
        SoftMaterial { young_pa: 2e5, poisson: 0.3, density_kg_m3: 100.0, viscosity_pa_s: 5.0 };
    legbot.end_effectors.iter_mut().for_each(|foot| foot.soft = Some(material));
    moving(&legbot, &rigid, "LegBot on soft feet of 27 nodes, 1/60 s", 1.0 / 60.0, 144);
    for count in [10, 20, 40] {
        chain(count);
    }
    block();
}
