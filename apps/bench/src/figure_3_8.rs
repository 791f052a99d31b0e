//! Figures 3.7 and 3.8 of the thesis: ANYmal ducks and turns in closed loop, with its deviations from the plans.

use crate::{Block, Findings, Verdict, inputs, table, unless_interrupted};
use miette::IntoDiagnostic;
use nalgebra::{Isometry3, Rotation3, Vector3};
use rollwalk_planner::plan::{Plan, Status};
use rollwalk_planner::plot::chart::{self, Curve};
use rollwalk_planner::whole_body::WholeBody;
use rollwalk_planner::{Options, optimise};
use rollwalk_simulate::sensors::Noise;
use rollwalk_simulate::{Control, Feedback, Mismatch, Moment, Script, play};
use rollwalk_terminal::{interrupt, output};
use serde::Serialize;

pub const MOTIONS: [&str; 2] = ["motions/anymal_duck.toml", "motions/anymal_turn.toml"];
/// Number of periods of the turn.
const CYCLES: usize = 2;
/// Controller ticks and simulation steps per second.
const RATE_HZ: u32 = 500;
/// Number of steps between rows.
const STEPS: usize = 5;
/// Coordinates of the body with their units.
const OF_BODY: [(&str, &str); 6] =
    [("ahead", "m"), ("left", "m"), ("up", "m"), ("roll", "rad"), ("pitch", "rad"), ("yaw", "rad")];
/// Largest deviation of a coordinate from the plan, m or rad.
const BOUND: f64 = 0.03;

/// Coordinates of the body in the order of [`OF_BODY`], and normal ground forces on the end effectors, N.
#[derive(Clone, Debug, Serialize)]
struct Pose {
    body: [f64; 6],
    normal_n: Vec<f64>,
}

/// Planned and tracked pose at a time of a motion.
#[derive(Serialize)]
struct Row {
    motion: String,
    time_s: f64,
    planned: Pose,
    tracked: Pose,
}

pub fn run() -> miette::Result<Option<Findings>> {
    let mut cells = table(["motion", "of the body", "unit", "worst difference", "at s", "RMS"]);
    let (mut rows, mut charts, mut text) = (Vec::new(), Vec::new(), Vec::new());
    let mut holds = true;
    for file in MOTIONS {
        let (robot, motion) = inputs::motion(file)?;
        let mut watch = |_: &_| unless_interrupted();
        let plan = optimise(&robot, &motion, &Options::default(), &mut watch);
        output::print_line(format_args!("{}: {:?}", motion.name, plan.solve.status));
        let (of_motion, stood) = track(&plan)?;
        if interrupt::requested() {
            return Ok(None);
        }
        for (of, (name, unit)) in OF_BODY.into_iter().enumerate() {
            let difference = |row: &Row| (row.tracked.body[of] - row.planned.body[of]).abs();
            let worst = of_motion.iter().max_by(|a, b| difference(a).total_cmp(&difference(b)));
            let (worst, at_s) =
                worst.map_or((f64::INFINITY, 0.0), |row| (difference(row), row.time_s));
            let squares: f64 = of_motion.iter().map(|row| difference(row).powi(2)).sum();
            let rms = (squares / of_motion.len() as f64).sqrt();
            holds &= worst <= BOUND;
            let [worst, rms] = [worst, rms].map(|value| format!("{value:.4}"));
            let names = [&*motion.name, name, unit].map(str::to_owned);
            cells.push(names.into_iter().chain([worst, format!("{at_s:.2}"), rms]).collect());
        }
        holds &= stood && plan.solve.status == Status::Converged;
        let fate = if stood {
            "no fall, meets the goals of the plan"
        } else {
            "falls, or misses the goals of the plan"
        };
        text.push(format!("{}: {fate}.", motion.name));
        charts.push((format!("figure-3-8-{}.svg", motion.name), draw(&plan, &of_motion)));
        rows.extend(of_motion);
    }
    text.push(format!(
        "Closed loop with gains, {RATE_HZ} ticks a second, state estimated from a noisy IMU and \
         noisy encoders; errors of the body up to {BOUND} m and rad are allowed."
    ));
    let verdict = if holds { Verdict::Passed } else { Verdict::OutOfBounds };
    let blocks = vec![Block::Table(cells), Block::Text(text.join("\n"))];
    Ok(Some(Findings { charts, verdict, ..Findings::new("figure-3-8", blocks, &rows) }))
}

/// Tracks a plan. Returns the poses of the motion, and true if the robot did not fall and covered the planned displacement.
fn track(plan: &Plan) -> miette::Result<(Vec<Row>, bool)> {
    let script = Script::new(plan, true);
    let options = rollwalk_simulate::Options {
        cycles: CYCLES,
        mismatch: Mismatch { noise: Some(Noise::USUAL), ..Mismatch::default() },
        ..rollwalk_simulate::Options::new(Control::Tracking(Feedback::Gains), RATE_HZ)
    };
    let mut planned = WholeBody::new(plan);
    let (mut rows, mut steps) = (Vec::new(), 0);
    let outcome = play(plan, &options, |moment| {
        steps += 1;
        let time_s = if script.repeats() { moment.done_s } else { moment.motion_s };
        let moves = script.repeats() || (time_s > 0.0 && time_s < script.duration_s());
        if moves && steps % STEPS == 0 {
            rows.push(row(plan, &mut planned, moment, time_s));
        }
        !interrupt::requested()
    })
    .into_diagnostic()?;
    Ok((rows, outcome.holds()))
}

fn row(plan: &Plan, planned: &mut WholeBody, moment: &Moment<'_>, time_s: f64) -> Row {
    let pose = |origin: Vector3<f64>, rotation, normal_n| {
        let (roll, pitch, yaw) = Rotation3::from_matrix_unchecked(rotation).euler_angles();
        Pose { body: [origin.x, origin.y, origin.z, roll, pitch, yaw], normal_n }
    };
    let there = planned.at(time_s, &Isometry3::identity());
    let wanted_n = there.force_n.iter().map(|force| force.z).collect();
    let (origin, rotation) = moment.world.base();
    let measured_n = moment.world.touches().map(|touch| touch.force.z).collect();
    Row {
        motion: plan.motion.name.clone(),
        time_s,
        planned: pose(there.state.base_position_m, there.state.world_from_body, wanted_n),
        tracked: pose(origin, rotation, measured_n),
    }
}

/// Draws body coordinates and ground forces over time, planned and tracked.
fn draw(plan: &Plan, rows: &[Row]) -> String {
    let curves = |pick: &dyn Fn(&Pose) -> f64| -> Vec<Curve> {
        let of = |name: &str, pose: fn(&Row) -> &Pose| {
            (name.to_owned(), rows.iter().map(|row| (row.time_s, pick(pose(row)))).collect())
        };
        vec![of("planned", |row| &row.planned), of("tracked", |row| &row.tracked)]
    };
    let of_body = OF_BODY.iter().enumerate().map(|(of, (name, unit))| {
        (format!("{name}, {unit}"), curves(&|pose: &Pose| pose.body[of]))
    });
    let forces = plan.robot.end_effectors.iter().enumerate().map(|(j, end_effector)| {
        (format!("{}, N", end_effector.name), curves(&|pose: &Pose| pose.normal_n[j]))
    });
    let panels: Vec<(String, Vec<Curve>)> = of_body.chain(forces).collect();
    let title = format!("{}, planned and tracked", plan.motion.name);
    chart::panels(&title, "time, s", &panels, &[])
}
