//! CPU time and iterations of horizons. Simulated robots follow their horizons exactly and plan again every 0.1 to 0.3 s,
//! undisturbed and with a push. `cargo run --release -p rollwalk-planner --example replan_times -- FOLDER` runs it, where
//! FOLDER contains `robots` and `motions`.

use cpu_time::ProcessTime;
use rollwalk_multibody::State;
use rollwalk_planner::motion::Motion;
use rollwalk_planner::receding::{Gait, Horizon, HorizonOptions, MeasuredState, Steering};
use rollwalk_planner::whole_body::WholeBody;
use rollwalk_planner::{Options, optimise};
use rollwalk_robot::Robot;
use std::error::Error;
use std::ops::ControlFlow;
use std::path::Path;

/// Cases: robot, motion, duration of horizons in s, and number of samples between plans. Without a motion, all end effectors
/// stand, with samples 0.1 s apart.
const CASES: [(&str, Option<&str>, f64, u64); 5] = [
    ("agilebot", None, 1.0, 1),
    ("agilebot", Some("walk"), 1.6, 2),
    ("agilebot", Some("trot"), 0.8, 3),
    ("anymal_wheels", None, 1.0, 1),
    ("anymal_wheels", Some("anymal_turn"), 1.2, 2),
];
/// Pushes before a plan: changes of the velocity of the body, m/s.
const PUSHES_M_S: [f64; 3] = [0.0, 0.2, 0.5];
const PLANS: u64 = 100;

fn main() -> Result<(), Box<dyn Error>> {
    let folder = std::env::args().nth(1).unwrap_or_else(|| ".".into());
    let read = |part: &str, name: &str| {
        std::fs::read_to_string(Path::new(&folder).join(part).join(format!("{name}.toml")))
    };
    println!(
        "| robot | gait | push m/s | accepted | iterations 50 %, 90 %, 99 % | ms 50 %, 90 %, 99 % |"
    );
    println!("|---|---|---|---|---|---|");
    for (name, motion, duration_s, every) in CASES {
        let robot = Robot::from_toml(name, &read("robots", name)?)?;
        let gait = match motion {
            None => Gait::standing(&robot, 0.1)?,
            Some(motion) => {
                let motion = Motion::from_toml(motion, &read("motions", motion)?, &robot)?;
                let options = Options { refine: false, ..Options::default() };
                Gait::of(&optimise(&robot, &motion, &options, &mut |_| ControlFlow::Continue(())))?
            }
        };
        for push_m_s in PUSHES_M_S {
            let options = HorizonOptions { duration_s, ..HorizonOptions::default() };
            let horizon = Horizon::new(&robot, gait.clone(), options)?;
            let times = measured(&robot, horizon, every, push_m_s)?;
            let motion = motion.unwrap_or("stand");
            println!("| `{name}` | `{motion}` | {push_m_s} | {times}");
        }
    }
    Ok(())
}

/// Plans repeatedly, each time from a state on the previous plan. With a push, each plan is computed twice: the pushed plan is
/// measured, and the robot follows the other.
fn measured(
    robot: &Robot,
    mut horizon: Horizon,
    every: u64,
    push_m_s: f64,
) -> Result<String, Box<dyn Error>> {
    let mut state = State::nominal(horizon.tree());
    state.base_position_m.z = 0.0;
    let mut touches = vec![true; robot.end_effectors.len()];
    let (mut iterations, mut times_ms, mut accepted) = (Vec::new(), Vec::new(), 0);
    for k in 0..PLANS {
        let at = k * every;
        // Commands of a joystick: forward, forward with a turn, backward, and released.
        let [forward_m_s, turn_rad_s] =
            [[0.1, 0.0], [0.1, 0.2], [-0.1, 0.0], [0.0; 2]][(k / 25) as usize % 4];
        let steering = Steering { forward_m_s, left_m_s: 0.0, turn_rad_s };
        let mut plan = |state: &State| {
            let measured = MeasuredState { state, touches: &touches };
            horizon.plan(measured, at, steering, &mut |_| ControlFlow::Continue(()))
        };
        let mut pushed = state.clone();
        let (sin, cos) = (2.4 * k as f64).sin_cos();
        pushed.velocity[0] += push_m_s * cos;
        pushed.velocity[1] += push_m_s * sin;
        let begin = ProcessTime::now();
        let mut found = plan(&pushed)?;
        times_ms.push(1e3 * begin.elapsed().as_secs_f64());
        iterations.push(found.plan.solve.iterations as f64);
        accepted += u32::from(found.is_accepted());
        if push_m_s > 0.0 {
            found = plan(&state)?;
        }
        let time_s = every as f64 * horizon.interval_s();
        let then = WholeBody::new(&found.plan).at(time_s, &found.world_from_plan);
        (state, touches) = (then.state, then.stands);
    }
    let part =
        |sorted: &[f64], part: f64| sorted[((sorted.len() - 1) as f64 * part).round() as usize];
    let parts = |mut values: Vec<f64>| {
        values.sort_by(f64::total_cmp);
        [0.5, 0.9, 0.99].map(|share| format!("{:.0}", part(&values, share))).join(", ")
    };
    Ok(format!("{accepted} of {PLANS} | {} | {} |", parts(iterations), parts(times_ms)))
}
