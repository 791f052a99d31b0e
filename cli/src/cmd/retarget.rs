//! `rollwalk retarget`: corrects the setpoints of a plan for a robot with soft servos.

use crate::files::Output;
use crate::inputs::Source;
use crate::{Exit, inputs, interrupt, output};
use indicatif::ProgressBar;
use miette::{IntoDiagnostic, miette};
use rollwalk_physics::ground::Plane;
use rollwalk_planner::plan::Plan;
use rollwalk_robot::Robot;
use rollwalk_simulate::retarget::{Options, Retargeted, retarget};
use rollwalk_simulate::{Options as RunOptions, Outcome, play};
use serde::Serialize;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Find setpoints with which a robot with soft servos follows its plan.
///
/// Servos with small gains give way under the robot's weight: its feet come late and low, and it falls behind its plan. This adds a smooth
/// curve to the setpoints of each joint (`joint_correction_rad` of the samples), found by simulating the robot on level ground with derivatives,
/// so that its centre of mass goes where the plan says (thesis 4.7.2). The motion itself stays as it was planned. Prints what becomes of the
/// plan before and after; the exit code is 3 if it does not hold afterwards.
#[derive(clap::Args)]
#[command(after_long_help = "\
Examples:
  rollwalk retarget walk.plan.json -o walk.soft.json
  rollwalk retarget walk.plan.json --robot soft.toml --no-feed-forward -o walk.soft.json

Then: rollwalk simulate walk.soft.json --no-feed-forward")]
pub struct Args {
    /// Plan (JSON).
    #[arg(value_name = "PLAN.json")]
    plan: PathBuf,
    /// Robot file (TOML): the plan's robot with other gains or torque limits of its drives.
    #[arg(long, value_name = "ROBOT.toml")]
    robot: Option<PathBuf>,
    /// Where to write the plan with its corrections.
    #[arg(short, long, value_name = "FILE.json")]
    output: PathBuf,
    /// Leave the planned torques out: drives without feed-forward.
    #[arg(long)]
    no_feed_forward: bool,
    /// Knots of the curve of each joint over the motion.
    #[arg(long, value_name = "COUNT", default_value_t = Options::default().knots as u32, value_parser = clap::value_parser!(u32).range(5..=60))]
    knots: u32,
    /// Periods that are simulated of a motion that repeats.
    #[arg(long, value_name = "COUNT", default_value_t = Options::default().cycles as u32, value_parser = clap::value_parser!(u32).range(1..=20))]
    cycles: u32,
    /// Most iterations.
    #[arg(long, value_name = "COUNT", default_value_t = Options::default().iterations as u32, value_parser = clap::value_parser!(u32).range(1..=100))]
    iterations: u32,
    /// Print as JSON.
    #[arg(long)]
    json: bool,
}

/// Steps of the world per second, and periods, of the runs before and after.
const CHECK: (u32, usize) = (120, 5);

/// Output of `--json`.
#[derive(Serialize)]
struct Document<'a> {
    /// Objective at the beginning and after each iteration.
    costs: &'a [f64],
    rollouts: usize,
    largest_correction_rad: f64,
    before: &'a Outcome,
    after: &'a Outcome,
    holds: bool,
}

/// Runs the subcommand.
pub fn run(args: &Args) -> miette::Result<Exit> {
    let mut plan = inputs::plan(&args.plan)?;
    if let Some(path) = &args.robot {
        plan = on(plan, Source::Disk.robot(path)?, path)?;
    }
    let place = Output::at(&args.output)?;
    interrupt::listen();
    let played = |plan: &Plan| {
        let (rate_hz, cycles) = CHECK;
        let options = RunOptions {
            feed_forward: !args.no_feed_forward,
            cycles,
            rate_hz,
            ground: Arc::new(Plane::level()),
            shoves: Vec::new(),
        };
        play(plan, &options, |_| !interrupt::requested()).into_diagnostic()
    };
    let before = played(&plan)?;
    let options = Options {
        feed_forward: !args.no_feed_forward,
        cycles: args.cycles as usize,
        knots: args.knots as usize,
        iterations: args.iterations as usize,
        ..Options::default()
    };
    let bar = ProgressBar::new_spinner();
    let found = retarget(&plan, &options, |rollout| {
        bar.set_message(format!("rollout {rollout}"));
        bar.tick();
        !interrupt::requested()
    });
    bar.finish_and_clear();
    if interrupt::requested() {
        return Ok(Exit::Interrupted);
    }
    let found = found.ok_or_else(|| {
        miette!(
            help = "stiffer servos, feed-forward, or a slower motion keep it on its feet",
            "{} falls with its plan as it is, so that nothing can be learned of it",
            plan.robot.name
        )
    })?;
    let after = played(&found.plan)?;
    place.write(found.plan.to_json().as_bytes())?;
    let holds = after.holds();
    if args.json {
        output::print_json(&Document {
            costs: &found.costs,
            rollouts: found.rollouts,
            largest_correction_rad: found.largest_rad,
            before: &before,
            after: &after,
            holds,
        })?;
    } else {
        place.comment(&describe(&plan, &found, &before, &after))?;
        place.comment(&format!("wrote {}", args.output.display()))?;
    }
    Ok(if holds { Exit::Ok } else { Exit::DoesNotHold })
}

/// The plan for a robot with other drives.
fn on(plan: Plan, robot: Robot, path: &Path) -> miette::Result<Plan> {
    let name = path.display().to_string();
    let plan = Plan { robot, ..plan };
    plan.validate(&name).map_err(|error| {
        miette!(
            help = "give the robot file of the plan with other gains or limits of its drives; for another robot, plan again",
            "the plan does not fit {name}: {error}"
        )
    })?;
    Ok(plan)
}

fn describe(plan: &Plan, found: &Retargeted, before: &Outcome, after: &Outcome) -> String {
    let ratios = |outcome: &Outcome| {
        if let Some(time_s) = outcome.fell_at_s {
            return format!("falls after {time_s:.2} s");
        }
        let goals = ["forward", "left", "turn"].into_iter().enumerate();
        let ratios: Vec<_> = goals
            .filter_map(|(of, name)| Some(format!("{name} {:.3} of the plan", outcome.ratio(of)?)))
            .collect();
        if ratios.is_empty() { "stays where it is".to_owned() } else { ratios.join(", ") }
    };
    format!(
        "{} of {}\nbefore: {}\nafter:  {}\nobjective {:.4} to {:.6} in {} iterations, {} rollouts; setpoints moved by {:.3} rad at most",
        plan.motion.name,
        plan.robot.name,
        ratios(before),
        ratios(after),
        found.costs[0],
        found.costs[found.costs.len() - 1],
        found.costs.len() - 1,
        found.rollouts,
        found.largest_rad
    )
}
