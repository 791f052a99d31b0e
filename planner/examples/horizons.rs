//! Scratch: horizons from states of a gait with disturbances.
use cpu_time::ProcessTime;
use nalgebra::Isometry3;
use rollwalk_planner::motion::Motion;
use rollwalk_planner::receding::*;
use rollwalk_planner::whole_body::WholeBody;
use rollwalk_planner::{Options, optimise};
use rollwalk_robot::Robot;
use std::ops::ControlFlow;

fn main() {
    let args: Vec<String> = std::env::args().collect();
    let (robot, motion) = (&args[1], &args[2]);
    let seconds: f64 = args[3].parse().unwrap();
    let text = std::fs::read_to_string(format!("robots/{robot}.toml")).unwrap();
    let robot = Robot::from_toml("robot.toml", &text).unwrap();
    let gait = if let Some(spacing) = motion.strip_prefix("stand:") {
        Gait::standing(&robot, spacing.parse().unwrap()).unwrap()
    } else {
        let text = std::fs::read_to_string(format!("motions/{motion}.toml")).unwrap();
        let mut motion = Motion::from_toml("m.toml", &text, &robot).unwrap();
        motion.goal.forward_m = Some(0.0);
        motion.goal.turn_rad = Some(0.0);
        if let Some(n) = args.get(5) { let n: usize = n.parse().unwrap();
            let old = motion.stance.clone(); motion.stance = (0..n).map(|i| old[i * old.len() / n].clone()).collect(); }
        let options = Options { refine: false, ..Options::default() };
        let plan = optimise(&robot, &motion, &options, &mut |_| ControlFlow::Continue(()));
        println!("gait {} {} samples {}", plan.solve.status, plan.solve.iterations, plan.samples.len());
        Gait::of(&plan).unwrap()
    };
    let mut options = HorizonOptions { duration_s: seconds, ..Default::default() };
    let env = |name: &str, old: f64| std::env::var(name).ok().and_then(|s| s.parse().ok()).unwrap_or(old);
    options.weights.steering = env("WS", options.weights.steering);
    options.weights.posture = env("WP", options.weights.posture);
    options.weights.penalty = env("RHO", options.weights.penalty);
    options.settings.nearly_flat = env("NF", options.settings.nearly_flat);
    let mut horizon = Horizon::new(&robot, gait, options).unwrap();
    let h = horizon.interval_s();
    let mut body: Option<(WholeBody, Isometry3<f64>)> = None;
    let mut state = rollwalk_multibody::State::nominal(horizon.tree());
    let frames = rollwalk_multibody::Frames::new(horizon.tree(), &state.configuration());
    let lowest = (0..robot.end_effectors.len())
        .filter_map(|j| rollwalk_multibody::RimContact::new(horizon.tree(), &frames, j, &nalgebra::Vector3::z()))
        .map(|c| c.position().z).fold(f64::INFINITY, f64::min);
    state.base_position_m.z -= lowest;
    let mut touches = vec![true; robot.end_effectors.len()];
    let every: u64 = args[4].parse().unwrap();
    let mut at = 0u64;
    let speed: f64 = std::env::var("SPEED").ok().and_then(|s| s.parse().ok()).unwrap_or(0.2);
    let kick: f64 = std::env::var("KICK").ok().and_then(|s| s.parse().ok()).unwrap_or(0.0);
    let turn: f64 = std::env::var("TURN").ok().and_then(|s| s.parse().ok()).unwrap_or(0.0);
    let n = std::env::var("N").ok().and_then(|s| s.parse().ok()).unwrap_or(40u64);
    let verbose = std::env::var("V").is_ok();
    let mut random = fastrand::Rng::with_seed(1);
    for k in 0..n {
        let steering = Steering { forward_m_s: if k < n * 3 / 5 { speed } else { 0.0 }, left_m_s: 0.0, turn_rad_s: if k < n * 3 / 5 { turn } else { 0.0 } };
        if let Some((body, there)) = &mut body {
            let instant = body.at(every as f64 * h, there);
            state = instant.state;
            touches = instant.stands;
        }
        if kick > 0.0 {
            let angle = random.f64() * std::f64::consts::TAU;
            state.velocity[0] += kick * angle.cos();
            state.velocity[1] += kick * angle.sin();
        }
        let begin = ProcessTime::now();
        let measured = Measured { state: &state, touches: &touches };
        let mut log = |p: &rollwalk_planner::Progress| {
            if verbose { println!("    {} level {:.2} {} cost {:.5} damping {:.1e} step {:.2e}", p.iteration, p.worst_level, p.worst_constraint, p.cost, p.damping, p.step); }
            ControlFlow::Continue(()) };
        let found = horizon.plan(measured, at, steering, &mut log).unwrap();
        let took = begin.elapsed();
        let solve = &found.plan.solve;
        let v = &state.velocity;
        println!("{k:3} at {at} {:?} it {:3} {:.1} ms level {:.3} {} accepted {} v {:.3} {:.3} {:.3} w {:.3} z {:.3} x {:.3} down {}", solve.status, solve.iterations, took.as_secs_f64() * 1e3,
            solve.worst_level, solve.worst_constraint, found.is_accepted(), v[0], v[1], v[2], v[5], state.base_position_m.z, state.base_position_m.x,
            touches.iter().map(|t| if *t {'#'} else {'.'}).collect::<String>());
        if let Err(e) = found.plan.validate("p") { println!("   INVALID {e}"); }
        body = Some((WholeBody::new(&found.plan), found.world_from_plan));
        at += every;
    }
}
