//! `rollwalk retarget`: corrects the set-points of a plan, or of all motions of a library, for a robot with soft servos.

mod library;
mod plan;

use crate::played;
use indicatif::ProgressBar;
use miette::{Report, miette};
use rollwalk_planner::plan::Plan;
use rollwalk_robot::Robot;
use rollwalk_simulate::retarget::{self, Options, RetargetError, RetargetResult, retarget};
use rollwalk_simulate::{Control, RunOutcome};
use rollwalk_terminal::progress::Lines;
use rollwalk_terminal::{Exit, interrupt};
use serde::Serialize;
use std::path::{Path, PathBuf};

/// Find set-points with which a robot with soft servos follows its plan.
///
/// Servos with small gains yield under the robot's weight: its feet land late and low, and it falls behind its plan. This
/// command adds a smooth curve to the set-points of each joint (`joint_correction_rad` of the samples), so that the centre of
/// mass follows the plan (thesis 4.7.2). The curve is found by simulating the robot on level ground with derivatives. The
/// motion itself stays as planned. The command prints the simulation results before and after; the exit code is 3 if the
/// corrected plan fails its checks.
///
/// For a library file every motion is planned and corrected. The output is then a folder with the plans, the robot file and a
/// library file that names them. `rollwalk library build` plans its transitions, which blend the corrections of one motion into
/// those of the next.
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
    /// Robot file (TOML): the plan's robot with other gains or torque limits of its drives, or with softer feet.
    #[arg(long, value_name = "ROBOT.toml")]
    robot: Option<PathBuf>,
    /// Output file for the corrected plan; for a library a folder, created if it is missing.
    #[arg(short, long, value_name = "FILE.json|DIR")]
    output: PathBuf,
    /// Simulate drives without feed-forward of the planned torques.
    #[arg(long)]
    no_feed_forward: bool,
    /// Number of knots in the curve of each joint.
    #[arg(long, value_name = "COUNT", default_value_t = Options::default().knots as u32, value_parser = clap::value_parser!(u32).range(5..=60))]
    knots: u32,
    /// Number of simulated periods of a periodic motion.
    #[arg(long, value_name = "COUNT", default_value_t = Options::default().cycles as u32, value_parser = clap::value_parser!(u32).range(1..=20))]
    cycles: u32,
    /// Maximum number of iterations.
    #[arg(long, value_name = "COUNT", default_value_t = Options::default().iterations as u32, value_parser = clap::value_parser!(u32).range(1..=100))]
    iterations: u32,
    /// Print as JSON.
    #[arg(long)]
    json: bool,
}

/// Runs the subcommand.
pub fn run(args: &Args) -> miette::Result<Exit> {
    interrupt::install_handler();
    match args.input.extension().is_some_and(|ending| ending == "toml") {
        true => library::run(args),
        false => plan::run(args),
    }
}

/// Plan with its corrections, and the results of simulating it without and with them.
struct CorrectedPlan {
    /// Corrections; `None` if the robot falls with the uncorrected plan.
    found: Option<RetargetResult>,
    before: RunOutcome,
    after: RunOutcome,
}

/// Output of `--json` for a plan.
#[derive(Serialize)]
struct Document<'a> {
    motion: &'a str,
    /// Objective at the start and after each iteration.
    costs: &'a [f64],
    rollouts: usize,
    largest_correction_rad: f64,
    before: &'a RunOutcome,
    after: &'a RunOutcome,
    holds: bool,
}

fn refused(error: RetargetError) -> Report {
    let help = "play the plan with feed-forward torques, which needs no corrections";
    miette!(help = help, "{error}")
}

impl CorrectedPlan {
    /// Corrects a plan; returns `None` after Ctrl-C.
    fn find(plan: &Plan, args: &Args, feed_forward: bool) -> miette::Result<Option<Self>> {
        retarget::check(&plan.robot).map_err(refused)?;
        let control = if feed_forward { Control::FeedForward } else { Control::Servos };
        let options = Options {
            feed_forward,
            cycles: args.cycles as usize,
            knots: args.knots as usize,
            iterations: args.iterations as usize,
            ..Options::default()
        };
        // The simulation uses the steps for which the corrections were found. With longer steps, corrections for soft feet lose
        // a seventh of the distance.
        let played = |plan: &Plan| played::play(plan, control, options.rate_hz);
        let before = played(plan)?;
        let (bar, lines) = (ProgressBar::new_spinner(), Lines::begin());
        let found = retarget(plan, &options, |rollout| {
            let at = format!("{}: rollout {rollout}", plan.motion.name);
            lines.print(&at);
            bar.set_message(at);
            bar.tick();
            !interrupt::requested()
        });
        let found = found.map_err(refused)?;
        bar.finish_and_clear();
        let after = match &found {
            Some(found) if !interrupt::requested() => played(&found.plan)?,
            _ => before.clone(),
        };
        Ok((!interrupt::requested()).then_some(Self { found, before, after }))
    }

    /// Returns the corrected plan, or the uncorrected one if that is closer to its goals.
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

/// Maximum relative error of the displacement in a run; infinite after a fall.
fn off(outcome: &RunOutcome) -> f64 {
    if outcome.fell_at_s.is_some() {
        return f64::INFINITY;
    }
    (0..3).filter_map(|of| outcome.ratio(of)).map(|ratio| (ratio - 1.0).abs()).fold(0.0, f64::max)
}

/// Message about a plan with which the uncorrected robot falls.
fn falls(plan: &Plan) -> String {
    format!(
        "{} falls with the uncorrected plan, so there is no gradient to follow",
        plan.robot.name
    )
}

const STEADIER: &str = "use stiffer servos, feed-forward or a slower motion";

/// Replaces the robot of a plan by one with other drives or feet.
fn on(plan: Plan, robot: Robot, path: &Path) -> miette::Result<Plan> {
    let name = path.display().to_string();
    let robot = plan.motion.robot(&robot).into_owned();
    let plan = Plan { robot, ..plan };
    plan.validate(&name).map_err(|error| {
        miette!(
            help = "give the robot file of the plan, changed only in gains or limits of its \
                drives; for another robot, plan again",
            "the plan does not fit {name}: {error}"
        )
    })?;
    Ok(plan)
}
