//! CPU time of complete solves from standing, and of the torques of a plan. The solves are those of shipped motions, and of
//! rolling with 12 to 240 samples. The time per sample shows if the cost is linear in the number of samples.
//!
//! CPU time instead of wall time reduces the effect of other load on the machine. `cargo bench -p rollwalk-planner` compares
//! with the previous run.

use cpu_time::ProcessTime;
use criterion::measurement::{Measurement, ValueFormatter, WallTime};
use criterion::{BenchmarkId, Criterion, Throughput, criterion_group, criterion_main};
use rollwalk_planner::motion::Motion;
use rollwalk_planner::start::Start;
use rollwalk_planner::torque::InverseDynamics;
use rollwalk_planner::{Options, optimise};
use rollwalk_robot::Robot;
use std::hint::black_box;
use std::ops::ControlFlow;
use std::time::Duration;

/// Measurement of the CPU time of the process, formatted as criterion's wall time.
struct CpuTime(WallTime);

impl Measurement for CpuTime {
    type Intermediate = ProcessTime;
    type Value = Duration;

    fn start(&self) -> ProcessTime {
        ProcessTime::now()
    }
    fn end(&self, start: ProcessTime) -> Duration {
        start.elapsed()
    }
    fn add(&self, a: &Duration, b: &Duration) -> Duration {
        *a + *b
    }
    fn zero(&self) -> Duration {
        Duration::ZERO
    }
    fn to_f64(&self, value: &Duration) -> f64 {
        self.0.to_f64(value)
    }
    fn formatter(&self) -> &dyn ValueFormatter {
        self.0.formatter()
    }
}

fn agilebot() -> Robot {
    let text = include_str!("../../shipped/robots/agilebot.toml");
    Robot::from_toml("agilebot.toml", text).expect("shipped robots are valid")
}

fn motion(name: &str, text: &str, robot: &Robot) -> Motion {
    Motion::from_toml(name, text, robot).expect("shipped motions are valid")
}

fn run(robot: &Robot, motion: &Motion, iterations: usize) {
    let mut options = Options { start: Start::Standing, refine: false, ..Options::default() };
    options.settings.iterations = iterations;
    black_box(optimise(robot, motion, &options, &mut |_| ControlFlow::Continue(())));
}

fn shipped_motions(c: &mut Criterion<CpuTime>) {
    let robot = agilebot();
    let mut group = c.benchmark_group("solve");
    group.sample_size(10);
    for (name, text) in [
        ("walk", include_str!("../../shipped/motions/walk.toml")),
        ("drive_1m", include_str!("../../shipped/motions/drive_1m.toml")),
        ("turn_in_place", include_str!("../../shipped/motions/turn_in_place.toml")),
    ] {
        let motion = motion(name, text, &robot);
        group.bench_function(name, |b| b.iter(|| run(&robot, &motion, 300)));
    }
    group.finish();
}

fn samples(c: &mut Criterion<CpuTime>) {
    let robot = agilebot();
    let drive = motion("drive_1m", include_str!("../../shipped/motions/drive_1m.toml"), &robot);
    let mut group = c.benchmark_group("ten iterations of rolling");
    group.sample_size(10);
    for samples in [12, 24, 48, 120, 240] {
        let stance = vec![vec![true; robot.end_effectors.len()]; samples];
        let motion = Motion { stance, ..drive.clone() };
        group.throughput(Throughput::Elements(samples as u64));
        group.bench_function(BenchmarkId::from_parameter(samples), |b| {
            b.iter(|| run(&robot, &motion, 10));
        });
    }
    group.finish();
}

/// Measures the torques at every frame of a motion library, per frame.
fn torques(c: &mut Criterion<CpuTime>) {
    let robot = agilebot();
    let mut group = c.benchmark_group("torques at 60 Hz");
    group.sample_size(10);
    for (name, text) in [
        ("walk", include_str!("../../shipped/motions/walk.toml")),
        ("drive_1m", include_str!("../../shipped/motions/drive_1m.toml")),
    ] {
        let motion = motion(name, text, &robot);
        let plan =
            optimise(&robot, &motion, &Options::default(), &mut |_| ControlFlow::Continue(()));
        let frames = (60.0 * motion.duration_s).round() as usize;
        group.throughput(Throughput::Elements(frames as u64));
        group.bench_function(name, |b| {
            b.iter(|| {
                let mut inverse = InverseDynamics::new(&plan);
                (0..frames).for_each(|k| drop(black_box(inverse.at(k as f64 / 60.0))));
            });
        });
    }
    group.finish();
}

criterion_group! {
    name = benches;
    config = Criterion::default().with_measurement(CpuTime(WallTime));
    targets = shipped_motions, samples, torques
}
criterion_main!(benches);
