//! `rollwalk design optimise`: searches the best parameters within their bounds.

use super::outcome::{DesignOutput, Folder};
use super::{SolveDisplay, plan_original, read, report};
use miette::miette;
use rollwalk_design::optimise;
use rollwalk_design::plans::RepairOutcome;
use rollwalk_terminal::{Exit, output};
use std::cell::RefCell;
use std::path::PathBuf;

/// Find the parameters within their bounds that minimise the design's goal.
///
/// The `[goal]` of the design file lists quantities to minimise, and bounds to keep. Several motions are optimised together
/// (thesis 2.5.3). A robot that cannot perform a motion is repaired first, by the smallest changes that make the motion feasible;
/// without `[goal]` the command ends there. If no design within the bounds is better, the robot stays as it is. The command
/// writes the same files as `rollwalk design edit`, with a table of all design steps. The exit code is 3 if no design within the
/// bounds can perform the motions, if a motion fails its checks in simulation afterwards, or if a quantity under `keep` exceeds
/// its bound.
#[derive(clap::Args)]
#[command(after_long_help = "\
Examples:
  rollwalk design optimise designs/agilebot_legs.toml -o best
Then:
  rollwalk simulate best/walk.plan.json")]
pub struct Args {
    /// Design file (TOML).
    #[arg(value_name = "DESIGN.toml")]
    design: PathBuf,
    #[command(flatten)]
    folder: Folder,
}

/// Runs the subcommand.
pub fn run(args: &Args) -> miette::Result<Exit> {
    let designed = read(&args.design)?;
    // Missing names are reported before planning.
    if let Ok(original) = designed.at(designed.original()) {
        designed.all_defined(&original.motions).map_err(report)?;
    }
    let folder = args.folder.open(&designed)?;
    let shown = RefCell::new(SolveDisplay::new("planning"));
    let watch = &mut |motion: &str, state: &_| shown.borrow_mut().iteration(motion, state);
    let before = plan_original(&designed, watch)?;
    let (start, repairs) = match before.all_solved() {
        Ok(()) => (before.clone(), Vec::new()),
        Err(why) => {
            output::print_line(&why);
            shown.borrow_mut().now("repairing");
            match designed.repair(&before, watch).map_err(report)? {
                RepairOutcome::Feasible { plans, steps } => (*plans, steps),
                RepairOutcome::Nearest(nearest) => {
                    drop(shown);
                    output::print_line(&nearest);
                    return Ok(Exit::DoesNotHold);
                }
            }
        }
    };
    let found = match &designed.file.goal {
        Some(goal) => {
            shown.borrow_mut().now("step 1,");
            let mut taken = 0;
            let each = &mut |_: &_| {
                taken += 1;
                shown.borrow_mut().now(&format!("step {taken},"));
            };
            Some(optimise::optimise(&designed, &start, goal, watch, each).map_err(report)?)
        }
        None if repairs.is_empty() => {
            return Err(miette!(
                help = "add [goal] with minimise = { peak_joint_speed = 1.0 }; docs/design.md lists the quantities",
                "design `{}` has no [goal], and all its motions are feasible without changes",
                designed.file.name
            ));
        }
        None => None,
    };
    shown.borrow_mut().now("again");
    let last = found.as_ref().map_or(&start, |found| &found.plans);
    let predicted = |values: &[f64]| {
        // The search for a repair begins with the design that is nearest.
        found.as_ref().map_or(0.0, |found| found.predicted(&designed, values))
    };
    let mut after = designed.round_to_steps(last, &predicted, watch).map_err(report)?;
    if !after.all_hold() && last.all_hold() {
        output::print_line(
            "rounding the parameters to their steps makes a motion infeasible: give finer steps (`step_m` and similar keys)",
        );
    }
    let mut is_better = None;
    if let Some(goal) = &designed.file.goal {
        // The baseline is treated like the written plans: a repaired robot is compared with its repair.
        let baseline = match repairs.is_empty() {
            true => before.clone().polished(watch),
            false => designed.round_to_steps(&start, &|_| 0.0, watch),
        };
        let baseline = baseline.map_err(report)?;
        let better = optimise::is_better(&designed, goal, &after, &baseline);
        is_better = Some(better);
        after = if better { after } else { baseline };
    }
    drop(shown);
    let mut outcome = DesignOutput::new("optimise", &designed, Some(&before), &after);
    outcome.repairs = repairs;
    outcome.kept = designed.kept(&after);
    if let Some(found) = found {
        outcome.gain_of_predicted = found.gain_of_predicted();
        outcome.is_cut_short = found.is_cut_short();
        (outcome.steps, outcome.lost) = (found.steps, found.lost);
        (outcome.is_better, outcome.estimated_motions) = (is_better, found.estimated);
    }
    folder.write(&outcome, Some(&before), &after)
}
