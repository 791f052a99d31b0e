//! CPU time of derivatives with the direct and the adjoint method, compared with the simulation alone: AgileBot with 128
//! targets, and LegBot on soft feet with 96.
//!
//! `cargo run --release -p rollwalk-physics --example sensitivity_time`

use cpu_time::ProcessTime;
use nalgebra::{DVector, Vector3};
use rollwalk_multibody::ground::{Ground, Plane};
use rollwalk_physics::World;
use rollwalk_physics::curve::{Curve, Degree};
use rollwalk_physics::motor::Motor;
use rollwalk_physics::sensitivity::parameter::Control;
use rollwalk_physics::sensitivity::{Recorder, Residual, Rollout};
use rollwalk_physics::world::Parameters;
use rollwalk_robot::{Channel, Robot, SoftMaterial};
use std::sync::Arc;

const STEP_S: f64 = 1.0 / 60.0;
const RUNS: u32 = 5;

fn robot(name: &str) -> Robot {
    let path = format!("{}/../shipped/robots/{name}.toml", env!("CARGO_MANIFEST_DIR"));
    let text = std::fs::read_to_string(path).expect("the robot files are beside this crate");
    Robot::from_toml(name, &text).expect("shipped robot files are sound")
}

/// Simulates a robot that swings its joints and drives its wheels. `knots` is the number of recorded knots for each joint;
/// `None` records nothing.
fn run(
    robot: &Robot,
    parameters: &Parameters,
    steps: usize,
    knots: Option<usize>,
) -> Option<Rollout> {
    let ground: Arc<dyn Ground> = Arc::new(Plane::level());
    let mut world = World::standing(robot, &ground, parameters);
    let (motors, joints) = (world.motors().to_vec(), robot.joints.len());
    let mut recorder = knots.map(|knots| {
        let spacing_s = steps as f64 * STEP_S / (knots - 1) as f64;
        let curve =
            Curve { begin_s: 0.0, spacing_s, knots, degree: Degree::Cubic, periodic: false };
        let parameters = Control::of_all(&motors[..joints], &vec![true; joints], &Arc::new(curve));
        Recorder::new(world.system(), parameters)
    });
    for step in 1..=steps {
        let (sine, cosine) = (std::f64::consts::TAU * step as f64 * STEP_S).sin_cos();
        for (&motor, channel) in motors.iter().zip(robot.channels()) {
            let motor = world.system_mut().force_mut::<Motor>(motor);
            let law = &mut motor.expect("a channel's motor").law;
            match channel {
                Channel::Joint(joint) => {
                    law.position_rad = joint.nominal_rad + 0.03 * (1.0 - cosine);
                    law.speed_rad_s = 0.03 * std::f64::consts::TAU * sine;
                }
                Channel::Wheel(..) => law.speed_rad_s = 3.0 * (1.0 - cosine),
            }
        }
        let system = world.system_mut();
        let taken = match &mut recorder {
            Some(recorder) => system.step_recorded(STEP_S, recorder),
            None => system.step(STEP_S),
        };
        taken.expect("the step converges");
    }
    recorder.map(Recorder::finish)
}

/// Prints the shortest CPU time of several runs.
fn measure<T>(name: &str, mut what: impl FnMut() -> T) -> T {
    let mut shortest = f64::INFINITY;
    let mut result = None;
    for _ in 0..RUNS {
        let start = ProcessTime::now();
        result = Some(what());
        shortest = shortest.min(start.elapsed().as_secs_f64());
    }
    println!("{name:44} {:8.2} ms", 1e3 * shortest);
    result.expect("it ran")
}

/// Compares the CPU times of a robot's rollouts, with eight knots for each joint.
fn compare(robot: &Robot, parameters: &Parameters, name: &str, steps: usize) {
    println!("{name}, {steps} steps, {} targets", 8 * robot.joints.len());
    measure("simulation, with its setup", || run(robot, parameters, steps, None));
    let rollout = measure("recorded", || run(robot, parameters, steps, Some(8)));
    let rollout = rollout.expect("a record");
    let residuals: Vec<Residual> = (1..=rollout.steps())
        .flat_map(|step| [Vector3::x(), Vector3::y(), Vector3::z()].map(|axis| (step, axis)))
        .map(|(step, axis)| Residual::com(&rollout, step, &Vector3::zeros(), axis))
        .collect();
    measure("direct, all motions", || rollout.direct(|_, _| {}));
    let jacobian = measure("direct, centre of mass of each step", || rollout.jacobian(&residuals));
    let gradient = measure("adjoint, its squares", || rollout.gradient(&residuals));
    let values = residuals.iter().map(|residual| residual.value);
    let expected = jacobian.tr_mul(&DVector::from_iterator(residuals.len(), values));
    let error = (&expected - DVector::from_vec(gradient)).norm() / expected.norm();
    println!("{:44} {error:8.1e}", "difference of the gradients");
}

fn main() {
    let agilebot = robot("agilebot");
    let parameters = Parameters::new(&agilebot);
    compare(&agilebot, &parameters, "AgileBot", 96);
    compare(&agilebot, &parameters, "AgileBot", 3600);
    let mut legbot = robot("legbot");
    let rigid = Parameters::new(&legbot);
    let material =
        SoftMaterial { young_pa: 2e5, poisson: 0.3, density_kg_m3: 100.0, viscosity_pa_s: 5.0 };
    legbot.end_effectors.iter_mut().for_each(|foot| foot.soft = Some(material));
    compare(&legbot, &rigid, "LegBot on soft feet of 27 nodes", 144);
}
