//! Steers simulated robots for a minute each, and prints falls, rejected plans, velocities and latencies.
//!
//! Run `cargo run --release -p rollwalk-simulate --example steer -- shipped`. The folder contains `robots` and `motions`.

use rollwalk_planner::motion::Motion;
use rollwalk_planner::receding::{Gait, Horizon, HorizonOptions, Steering};
use rollwalk_planner::{Options as PlanOptions, optimise};
use rollwalk_robot::Robot;
use rollwalk_simulate::steered::{Command, Options, steer};
use std::error::Error;
use std::ops::ControlFlow;
use std::path::Path;

/// Robot, motion, length of the horizon in s, and samples between plans. Without a motion all end effectors stand, and samples
/// are 0.1 s apart.
const CASES: [(&str, Option<&str>, f64, usize); 4] = [
    ("agilebot", Some("walk"), 1.6, 2),
    ("agilebot", Some("trot"), 0.8, 3),
    ("agilebot", None, 1.0, 1),
    ("anymal_wheels", Some("anymal_turn"), 1.2, 2),
];
/// Rest before the first command, s.
const REST_S: f64 = 1.0;
/// Duration of each command, s.
const KEPT_S: f64 = 10.0;
const FORWARD_M_S: f64 = 0.15;
const TURN_RAD_S: f64 = 0.3;

fn main() -> Result<(), Box<dyn Error>> {
    let folder = std::env::args().nth(1).unwrap_or_else(|| ".".into());
    let read = |part: &str, name: &str| {
        std::fs::read_to_string(Path::new(&folder).join(part).join(format!("{name}.toml")))
    };
    println!(
        "| robot, gait | run s | fell s | plans, not accepted | forward m/s | turn rad/s | latency \
         s: forward, turn, stop |"
    );
    println!("|---|---|---|---|---|---|---|");
    for (name, motion, duration_s, replan_samples) in CASES {
        let robot = Robot::from_toml(name, &read("robots", name)?)?;
        let gait = match motion {
            None => Gait::standing(&robot, 0.1)?,
            Some(motion) => {
                let motion = Motion::from_toml(motion, &read("motions", motion)?, &robot)?;
                let options = PlanOptions { refine: false, ..PlanOptions::default() };
                Gait::of(&optimise(&robot, &motion, &options, &mut |_| ControlFlow::Continue(())))?
            }
        };
        let period_s = gait.interval_s() * gait.samples() as f64;
        let stand = Gait::standing(&robot, gait.interval_s())?;
        let options = HorizonOptions { duration_s, ..HorizonOptions::default() };
        let horizon = Horizon::new(&robot, stand.clone(), options)?;
        let begins_s = |k: usize| REST_S + KEPT_S * k as f64;
        // Step in place, forward, forward with a turn, turn, step in place, stand.
        let wanted = [
            [0.0; 2],
            [FORWARD_M_S, 0.0],
            [FORWARD_M_S, TURN_RAD_S],
            [0.0, TURN_RAD_S],
            [0.0; 2],
            [0.0; 2],
        ];
        let mut commands: Vec<Command> = (0..)
            .zip(wanted)
            .map(|(k, [forward_m_s, turn_rad_s])| Command {
                at_s: begins_s(k),
                steering: Steering { forward_m_s, left_m_s: 0.0, turn_rad_s },
                gait: None,
            })
            .collect();
        commands[0].gait = Some(gait);
        commands[wanted.len() - 1].gait = Some(stand);
        let duration_s = begins_s(wanted.len());
        let options =
            Options { duration_s, replan_samples, planning_s: 0.09, ..Options::default() };
        let outcome = steer(&robot, horizon, &commands, &options, &mut |_| {})?;
        // The second half of a command.
        let settled = |k: usize| outcome.mean(begins_s(k) + 0.5 * KEPT_S, begins_s(k) + KEPT_S);
        let latency = |k: usize, c: usize, change: [f64; 2]| {
            let latency_s = outcome.latency_s(begins_s(k), c, change, period_s);
            latency_s.map_or("never".to_owned(), |latency_s| format!("{latency_s:.2}"))
        };
        println!(
            "| `{name}`, `{}` | {:.0} | {} | {}, {} | {:.3} | {:.3} | {}, {}, {} |",
            motion.unwrap_or("stand"),
            outcome.time_s,
            outcome.fell_at_s.map_or("no".to_owned(), |at_s| format!("{at_s:.1}")),
            outcome.plans.len(),
            outcome.rejected(),
            settled(1)[0],
            settled(2)[2],
            latency(1, 0, [0.0, FORWARD_M_S]),
            latency(2, 2, [0.0, TURN_RAD_S]),
            latency(3, 0, [FORWARD_M_S, 0.0]),
        );
    }
    Ok(())
}
