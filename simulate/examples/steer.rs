//! Scratch: a steered run.
use rollwalk_planner::motion::Motion;
use rollwalk_planner::receding::*;
use rollwalk_planner::{Options, optimise};
use rollwalk_robot::Robot;
use rollwalk_simulate::steered::{self, Command};
use std::ops::ControlFlow;

fn main() {
    let args: Vec<String> = std::env::args().collect();
    let env = |name: &str, old: f64| std::env::var(name).ok().and_then(|s| s.parse().ok()).unwrap_or(old);
    let text = std::fs::read_to_string(format!("robots/{}.toml", args[1])).unwrap();
    let robot = Robot::from_toml("robot.toml", &text).unwrap();
    let gait = if let Some(spacing) = args[2].strip_prefix("stand:") {
        Gait::standing(&robot, spacing.parse().unwrap()).unwrap()
    } else {
        let text = std::fs::read_to_string(format!("motions/{}.toml", args[2])).unwrap();
        let mut motion = Motion::from_toml("m.toml", &text, &robot).unwrap();
        motion.goal.forward_m = Some(0.0);
        motion.goal.turn_rad = Some(0.0);
        let options = Options { refine: false, ..Options::default() };
        Gait::of(&optimise(&robot, &motion, &options, &mut |_| ControlFlow::Continue(()))).unwrap()
    };
    let seconds: f64 = args[3].parse().unwrap();
    let every: usize = args[4].parse().unwrap();
    let period = gait.interval_s() * gait.samples() as f64;
    let options = HorizonOptions { duration_s: seconds, ..Default::default() };
    let start = Gait::standing(&robot, gait.interval_s()).unwrap();
    let horizon = Horizon::new(&robot, start.clone(), options).unwrap();
    let (v, w) = (env("SPEED", 0.15), env("TURN", 0.3));
    let steering = |forward_m_s, left_m_s, turn_rad_s| Steering { forward_m_s, left_m_s, turn_rad_s };
    let d = env("LEG", 4.0);
    let commands = vec![
        Command { at_s: 1.0, steering: steering(0.0, 0.0, 0.0), gait: Some(gait.clone()) },
        Command { at_s: 1.0 + d, steering: steering(v, 0.0, 0.0), gait: None },
        Command { at_s: 1.0 + 2.0 * d, steering: steering(v, 0.0, w), gait: None },
        Command { at_s: 1.0 + 3.0 * d, steering: steering(0.0, 0.0, w), gait: None },
        Command { at_s: 1.0 + 4.0 * d, steering: steering(0.0, 0.0, 0.0), gait: None },
        Command { at_s: 1.0 + 5.0 * d, steering: steering(0.0, 0.0, 0.0), gait: Some(start) },
    ];
    let options = steered::Options {
        duration_s: 1.0 + 6.0 * d,
        replan_samples: every,
        planning_s: env("PLANNING", 0.09),
        iterations: env("ITERATIONS", 20.0) as usize,
        ..Default::default()
    };
    let outcome = steered::steer(&robot, horizon, &commands, &options).unwrap();
    let its: Vec<usize> = outcome.plans.iter().map(|p| p.0).collect();
    println!("fell {:?} time {:.2} plans {} rejected {} untracked {} max it {:?}", outcome.fell_at_s, outcome.time_s, outcome.plans.len(), outcome.rejected(), outcome.untracked, its.iter().max());
    for k in 0..6 {
        let from = 1.0 + k as f64 * d;
        let m = outcome.mean(from + d / 2.0, from + d);
        println!("leg {k}: mean {:.3} {:.3} {:.3}", m[0], m[1], m[2]);
    }
    println!("latency forward {:?} turn {:?} stop {:?}", outcome.latency_s(1.0 + d, 0, [0.0, v], period), outcome.latency_s(1.0 + 2.0 * d, 2, [0.0, w], period), outcome.latency_s(1.0 + 3.0 * d, 0, [v, 0.0], period));
    if std::env::var("V").is_ok() { println!("{:?}", outcome.plans); }
}
