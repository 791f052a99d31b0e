//! `rollwalk retarget`: corrects the setpoints of a plan, or of all motions of a library, for a robot that gives way.

mod library;
mod plan;

use crate::played;
use indicatif::ProgressBar;
use miette::miette;
use rollwalk_planner::plan::Plan;
use rollwalk_robot::Robot;
use rollwalk_simulate::retarget::{Options, Retargeted, retarget};
use rollwalk_simulate::{Control, Outcome};
use rollwalk_terminal::progress::Lines;
use rollwalk_terminal::{Exit, interrupt};
use serde::Serialize;
use std::path::{Path, PathBuf};

/// Find setpoints with which a robot with soft servos follows its plan.
///
/// Servos with small gains give way under the robot's weight: its feet come late and low, and it falls behind its plan. This
/// adds a smooth curve to the setpoints of each joint (`joint_correction_rad` of the samples), found by simulating the robot on
/// level ground with derivatives, so that its centre of mass goes where the plan says (thesis 4.7.2). The motion itself stays
/// as it was planned. Prints what becomes of the plan before and after; the exit code is 3 if it does not hold afterwards.
///
/// Of a library file every motion is planned and corrected. The output is then a folder with the plans, the robot file and a
/// library file that names them; `rollwalk library build` plans its transitions, which lead from one motion's corrections to
/// the next one's.
#[derive(clap::Args)]
#[command(after_long_help = "\
Examples:
  rollwalk retarget walk.plan.json -o walk.soft.json
  rollwalk retarget walk.plan.json --robot soft.toml --no-feed-forward -o walk.soft.json
  rollwalk retarget motions/agilebot_library.toml --robot soft.toml -o soft

Then: rollwalk simulate walk.soft.json --no-feed-forward --rate 240
      rollwalk library build soft/library.toml -o soft.rwl")]
pub struct Args {
    /// Plan (JSON) or library file (TOML).
    #[arg(value_name = "PLAN.json|LIBRARY.toml")]
    input: PathBuf,
    /// Robot file (TOML): the plan's robot with other gains or torque limits of its drives, or softer feet.
    #[arg(long, value_name = "ROBOT.toml")]
    robot: Option<PathBuf>,
    /// Corrected plan to write; for a library a folder, made if it is missing.
    #[arg(short, long, value_name = "FILE.json|DIR")]
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

/// Runs the subcommand.
pub fn run(args: &Args) -> miette::Result<Exit> {
    interrupt::listen();
    match args.input.extension().is_some_and(|ending| ending == "toml") {
        true => library::run(args),
        false => plan::run(args),
    }
}

/// A plan with its corrections, and what becomes of it without and with them.
struct Corrected {
    /// Corrections; `None` if the robot falls with the uncorrected plan.
    found: Option<Retargeted>,
    before: Outcome,
    after: Outcome,
}

/// Output of `--json` for a plan.
#[derive(Serialize)]
struct Document<'a> {
    motion: &'a str,
    /// Objective at the beginning and after each iteration.
    costs: &'a [f64],
    rollouts: usize,
    largest_correction_rad: f64,
    before: &'a Outcome,
    after: &'a Outcome,
    holds: bool,
}

impl Corrected {
    /// Corrects a plan; none after Ctrl-C.
    fn find(plan: &Plan, args: &Args, feed_forward: bool) -> miette::Result<Option<Self>> {
        let control = if feed_forward { Control::FeedForward } else { Control::Servos };
        let options = Options {
            feed_forward,
            cycles: args.cycles as usize,
            knots: args.knots as usize,
            iterations: args.iterations as usize,
            ..Options::default()
        };
        // In the steps for which they are found: in longer ones corrections for soft feet lose a seventh of the way.
        let played = |plan: &Plan| played::play(plan, control, options.rate_hz);
        let before = played(plan)?;
        let (bar, lines) = (ProgressBar::new_spinner(), Lines::begin());
        let found = retarget(plan, &options, |rollout| {
            let at = format!("{}: rollout {rollout}", plan.motion.name);
            lines.say(&at);
            bar.set_message(at);
            bar.tick();
            !interrupt::requested()
        });
        bar.finish_and_clear();
        let after = match &found {
            Some(found) if !interrupt::requested() => played(&found.plan)?,
            _ => before.clone(),
        };
        Ok((!interrupt::requested()).then_some(Self { found, before, after }))
    }

    /// The plan that comes nearer to where it says: with its corrections, unless it came nearer without.
    fn better<'a>(&'a self, plan: &'a Plan) -> &'a Plan {
        let found = self.found.as_ref().filter(|_| off(&self.after) <= off(&self.before));
        found.map_or(plan, |found| &found.plan)
    }

    fn holds(&self) -> bool {
        self.found.is_some() && self.after.holds()
    }

    fn document<'a>(&'a self, plan: &'a Plan) -> Document<'a> {
        let found = self.found.as_ref();
        Document {
            motion: &plan.motion.name,
            costs: found.map_or(&[], |found| &found.costs),
            rollouts: found.map_or(0, |found| found.rollouts),
            largest_correction_rad: found.map_or(0.0, |found| found.largest_rad),
            before: &self.before,
            after: &self.after,
            holds: self.holds(),
        }
    }
}

/// Largest relative error of a run's way against its plan; infinite after a fall.
fn off(outcome: &Outcome) -> f64 {
    if outcome.fell_at_s.is_some() {
        return f64::INFINITY;
    }
    (0..3).filter_map(|of| outcome.ratio(of)).map(|ratio| (ratio - 1.0).abs()).fold(0.0, f64::max)
}

/// Message for a plan with which the robot falls uncorrected.
fn falls(plan: &Plan) -> String {
    format!(
        "{} falls with its plan as it is, so that nothing can be learned of it",
        plan.robot.name
    )
}

const STEADIER: &str = "stiffer servos, feed-forward, or a slower motion keep it on its feet";

/// The plan for a robot with other drives or feet.
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
