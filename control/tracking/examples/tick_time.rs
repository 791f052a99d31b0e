//! Measures the CPU time of ticks and counts failed ones, at random states near a stand, with random feet on the ground.
//!
//! Run `cargo run --release -p rollwalk-tracking --example tick_time -- TICKS ROBOT.toml...`.

use cpu_time::ThreadTime;
use fastrand::Rng;
use nalgebra::{Isometry3, Rotation3, Vector3};
use rollwalk_multibody::{Standing, State, Tree};
use rollwalk_robot::{GRAVITY_M_S2, Robot};
use rollwalk_tracking::model::Costs;
use rollwalk_tracking::tasks::Weights;
use rollwalk_tracking::{Gains, Reference, Tracker};

fn main() {
    let mut args = std::env::args().skip(1);
    let ticks: usize = args.next().and_then(|text| text.parse().ok()).unwrap_or(10_000);
    println!(
        "{:24} {:>8} {:>8} {:>8} {:>8} {:>7} {:>9}",
        "", "median", "99 %", "99.9 %", "most", "failed", "steps"
    );
    for path in args {
        let text = std::fs::read_to_string(&path).expect("ROBOT.toml can be read");
        let robot = Robot::from_toml(&path, &text).expect("it is a robot");
        measure(&robot, ticks);
    }
}

fn measure(robot: &Robot, ticks: usize) {
    let tree = Tree::new(robot).with_spinning_wheels(|_| 1e-6).with_armature();
    let feet = robot.end_effectors.len();
    let part_n = tree.total_mass_kg() * GRAVITY_M_S2 / feet as f64;
    // States are near the nominal state, whose body is at the origin. The ground is below the body.
    let body_m = Standing::new(&tree).expect("no wheel lies flat").frames.link_origins[0].z;
    let mut reference = Reference {
        time_s: 0.0,
        world_from_ground: Isometry3::translation(0.0, 0.0, -body_m),
        state: State::nominal(&tree),
        acceleration: vec![0.0; tree.dofs()],
        stands: vec![true; feet],
        force_n: vec![Vector3::z() * part_n; feet],
        ground_height_m: vec![0.0; feet],
        ground_normal: vec![Vector3::z(); feet],
    };
    let mut state = reference.state.clone();
    let gains = Gains::new(&tree, &Costs::default(), 1.0, true, |_| reference.clone());
    let mut tracker = Tracker::new(tree, Weights::default(), 0.002).with_gains(gains);
    let mut random = Rng::with_seed(1);
    let (mut times_us, mut failed, mut steps) = (Vec::with_capacity(ticks), 0, 0_u32);
    for _ in 0..ticks {
        let mut error = |size: f64| size * (2.0 * random.f64() - 1.0);
        state.base_position_m = Vector3::from_fn(|_, _| error(0.02));
        let turn = Vector3::from_fn(|_, _| error(0.15));
        state.world_from_body = Rotation3::new(turn).into_inner();
        for (angle, planned) in state.joint_rad.iter_mut().zip(&reference.state.joint_rad) {
            *angle = planned + error(0.1);
        }
        state.velocity.iter_mut().for_each(|speed| *speed = error(0.3));
        reference.stands.iter_mut().for_each(|stands| *stands = random.bool() || random.bool());
        let before = ThreadTime::now();
        failed += usize::from(tracker.tick(&reference, &state, &reference.stands).is_err());
        times_us.push(1e6 * before.elapsed().as_secs_f64());
        steps = steps.max(tracker.steps());
    }
    times_us.sort_by(f64::total_cmp);
    let at = |part: f64| times_us[((part * ticks as f64) as usize).min(ticks - 1)];
    println!(
        "{:24} {:5.0} µs {:5.0} µs {:5.0} µs {:5.0} µs {failed:7} {steps:9}",
        robot.name,
        at(0.5),
        at(0.99),
        at(0.999),
        at(1.0)
    );
}
