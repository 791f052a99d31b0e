//! `rollwalk design optimise`: the best parameters within their bounds.

use super::outcome::{Folder, Outcome};
use super::{Shown, plan_original, read, report};
use crate::Exit;
use miette::miette;
use rollwalk_design::optimise;
use std::cell::RefCell;
use std::path::PathBuf;

/// Find parameters within their bounds with which the motions are best.
///
/// What is best stands in the design file's `[goal]`: quantities to minimise, and bounds to keep. Several motions are optimised
/// at once (thesis 2.5.3). Writes what `rollwalk design edit` writes, with a row for every step of the design.
#[derive(clap::Args)]
#[command(after_long_help = "\
Examples:
  rollwalk design optimise designs/agilebot_legs.toml -o best
Then:
  rollwalk simulate best/walk.plan.json")]
pub struct Args {
    /// Design file (TOML) with a `[goal]`.
    #[arg(value_name = "DESIGN.toml")]
    design: PathBuf,
    #[command(flatten)]
    folder: Folder,
}

/// Runs the subcommand.
pub fn run(args: &Args) -> miette::Result<Exit> {
    let designed = read(&args.design)?;
    let Some(goal) = &designed.file.goal else {
        return Err(miette!(
            help = "add [goal] with minimise = { peak_joint_speed = 1.0 }; docs/design.md lists the quantities",
            "design `{}` has no [goal]",
            designed.file.name
        ));
    };
    let folder = args.folder.open(&designed)?;
    let shown = RefCell::new(Shown::new("planning"));
    let before = plan_original(&designed, &mut shown.borrow_mut())?;
    shown.borrow_mut().now("step 1,");
    let mut taken = 0;
    let found = optimise::optimise(
        &designed,
        &before,
        goal,
        &mut |motion, state| shown.borrow_mut().iteration(motion, state),
        &mut |_| {
            taken += 1;
            shown.borrow_mut().now(&format!("step {taken},"));
        },
    )
    .map_err(report)?;
    let mut shown = shown.into_inner();
    shown.now("again");
    let values = designed.rounded(&found.plans.variant.values);
    let after = designed
        .plan_from(&found.plans, &values, true, &mut |motion, state| shown.iteration(motion, state))
        .map_err(report)?;
    drop(shown);
    let mut outcome = Outcome::new("optimise", &designed, &before, &after)?;
    (outcome.steps, outcome.lost) = (found.steps, found.lost);
    folder.write(&outcome, &before, &after)
}
