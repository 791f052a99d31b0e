//! `rollwalk plot`: a plan as a figure.

use crate::{Exit, files, inputs, output};
use rollwalk_planner::plot;
use std::path::PathBuf;

/// Draw a plan as SVG: footfalls, centre of mass, joint angles, wheel speeds, ground forces.
#[derive(clap::Args)]
#[command(after_long_help = "\
Examples:
  rollwalk plot walk.plan.json -o walk.svg")]
pub struct Args {
    /// Plan (JSON).
    #[arg(value_name = "PLAN.json")]
    plan: PathBuf,
    /// Where to write the figure.
    #[arg(short, long, value_name = "FILE.svg")]
    output: PathBuf,
}

/// Runs the subcommand.
pub fn run(args: &Args) -> miette::Result<Exit> {
    let plan = inputs::plan(&args.plan)?;
    files::write(&args.output, plot::figure(&plan).as_bytes())?;
    output::print(&format!("wrote {}", args.output.display()))?;
    Ok(Exit::Ok)
}
