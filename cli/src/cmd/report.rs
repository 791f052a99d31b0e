//! `rollwalk report`: recomputes the residuals of a plan.

use rollwalk_planner::plan::{Plan, SolveSummary};
use rollwalk_planner::report::Report;
use rollwalk_terminal::{Exit, inputs, output};
use serde::Serialize;
use std::path::PathBuf;

/// Recompute every residual of a plan and print the worst of each kind, with location and unit.
///
/// Nothing is taken from the optimiser: the equations are evaluated again from the values of the plan, at its samples and
/// between them, as servos will play it. The exit code is 3 if the plan is not consistent. `rollwalk plan` and `rollwalk
/// simulate` check the motion in simulation.
#[derive(clap::Args)]
#[command(after_long_help = "\
Examples:
  rollwalk report walk.plan.json
  rollwalk report walk.plan.json --json | jq '.rows[] | select(.name == \"slip\")'

The file format is described in docs/formats/plan-format.md.")]
pub struct Args {
    /// Plan (JSON).
    #[arg(value_name = "PLAN.json")]
    plan: PathBuf,
    /// Print as JSON.
    #[arg(long)]
    json: bool,
}

/// Output of `--json`.
#[derive(Serialize)]
struct Document<'a> {
    #[serde(flatten)]
    report: &'a Report,
    consistent: bool,
    solve: &'a SolveSummary,
}

/// Runs the subcommand.
pub fn run(args: &Args) -> miette::Result<Exit> {
    let plan = inputs::plan(&args.plan)?;
    let report = Report::new(&plan);
    let consistent = report.judgement.is_good();
    if args.json {
        output::print_json(&Document { report: &report, consistent, solve: &plan.solve })?;
    } else {
        output::print(&describe(&plan, &report))?;
    }
    Ok(report.judgement.into())
}

fn describe(plan: &Plan, report: &Report) -> String {
    let SolveSummary { status, iterations, energy, .. } = &plan.solve;
    format!(
        "{report}the optimiser: {status} after {iterations} iterations, energy {energy:.6}\n{}",
        report.words(&plan.solve)
    )
}
