//! Figure 3.6 of the thesis: planned and simulated trajectories of the body in ANYmal's forward duck, open loop.

use crate::{Block, Findings, Verdict, inputs, table, unless_interrupted};
use miette::IntoDiagnostic;
use nalgebra::{Matrix3, Vector3};
use rollwalk_planner::plan::Status;
use rollwalk_planner::plot::chart::{self, Curve, Labels};
use rollwalk_planner::{Options, optimise};
use rollwalk_simulate::{Control, Script, play};
use rollwalk_terminal::{interrupt, output};
use serde::Serialize;

pub const MOTION: &str = "motions/anymal_duck.toml";
/// Simulation steps per second.
const RATE_HZ: u32 = 240;
/// Largest deviation of the simulated body from the plan: forward and up in m, pitch in rad.
const BOUNDS: [f64; 3] = [0.02, 0.02, 0.03];
const NAMES: [(&str, &str); 3] = [("ahead", "m"), ("up", "m"), ("pitch", "rad")];

/// Pose of the body: forward and up in m; pitch in rad, nose down.
type BodyPose = [f64; 3];

/// Poses at a time of the motion.
#[derive(Serialize)]
struct Row {
    time_s: f64,
    planned: BodyPose,
    simulated: BodyPose,
}

pub fn run() -> miette::Result<Option<Findings>> {
    let (robot, motion) = inputs::motion(MOTION)?;
    let mut watch = |_: &_| unless_interrupted();
    let plan = optimise(&robot, &motion, &Options::default(), &mut watch);
    if interrupt::requested() {
        return Ok(None);
    }
    output::print_line(format_args!("{}: {:?}", motion.name, plan.solve.status));
    let script = Script::new(&plan, true);
    let options = rollwalk_simulate::Options {
        cycles: 1,
        ..rollwalk_simulate::Options::new(Control::FeedForward, RATE_HZ)
    };
    let mut rows = Vec::new();
    let outcome = play(&plan, &options, |moment| {
        if moment.motion_s > 0.0 && moment.motion_s < script.duration_s() {
            let (planned, simulated) = (script.base(moment.motion_s), moment.world.base());
            let place = |(origin, rotation): (Vector3<f64>, Matrix3<f64>)| {
                [origin.x, origin.z, (-rotation[(2, 0)]).asin()]
            };
            rows.push(Row {
                time_s: moment.motion_s,
                planned: place(planned),
                simulated: place(simulated),
            });
        }
        !interrupt::requested()
    })
    .into_diagnostic()?;
    if interrupt::requested() {
        return Ok(None);
    }
    let mut cells = table(["of the body", "unit", "worst difference", "at s", "RMS", "bound"]);
    let (mut charts, mut within) = (Vec::new(), true);
    for (of, (name, unit)) in NAMES.into_iter().enumerate() {
        let difference = |row: &Row| (row.simulated[of] - row.planned[of]).abs();
        let worst = rows.iter().max_by(|a, b| difference(a).total_cmp(&difference(b)));
        let (worst, at_s) = worst.map_or((f64::INFINITY, 0.0), |row| (difference(row), row.time_s));
        let squares: f64 = rows.iter().map(|row| difference(row).powi(2)).sum();
        within &= worst <= BOUNDS[of];
        cells.push(vec![
            name.into(),
            unit.into(),
            format!("{worst:.4}"),
            format!("{at_s:.2}"),
            format!("{:.4}", (squares / rows.len() as f64).sqrt()),
            BOUNDS[of].to_string(),
        ]);
        let curve = |name: &str, pick: fn(&Row) -> BodyPose| -> Curve {
            (name.into(), rows.iter().map(|row| (row.time_s, pick(row)[of])).collect())
        };
        let curves = [curve("planned", |row| row.planned), curve("simulated", |row| row.simulated)];
        let title = format!("Forward duck of ANYmal: the body, {name}");
        let labels = Labels { title: &title, x: "time, s", y: &format!("{name}, {unit}") };
        charts.push((format!("figure-3-6-{name}.svg"), chart::linear(&labels, &curves)));
    }
    let text = format!(
        "{}, open loop with the planned torques, implicit steps of 1/{RATE_HZ} s: {:.2} s with a second of rest before and after, {:.2} iterations a step, {}.",
        motion.name,
        outcome.time_s,
        outcome.iterations,
        if outcome.fell_at_s.is_some() { "the robot fell" } else { "no fall" },
    );
    let holds = within && outcome.holds() && plan.solve.status == Status::Converged;
    let verdict = if holds { Verdict::Passed } else { Verdict::OutOfBounds };
    let blocks = vec![Block::Table(cells), Block::Text(text)];
    Ok(Some(Findings { charts, verdict, ..Findings::new("figure-3-6", blocks, &rows) }))
}
