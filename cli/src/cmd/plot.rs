//! `rollwalk plot`: plans as figures.

use crate::files::{self, Output};
use crate::{Exit, inputs};
use rollwalk_planner::plan::Plan;
use rollwalk_planner::plot;
use std::path::PathBuf;

/// Pictures of a motion in a strip.
pub const STRIP_MOMENTS: usize = 6;

/// Draw a plan as SVG: footfalls, centre of mass, joint angles, wheel speeds, ground forces.
#[derive(clap::Args)]
#[command(after_long_help = "\
Examples:
  rollwalk plot walk.plan.json -o walk.svg
  rollwalk plot --strip drive.plan.json walk.plan.json -o robot.svg")]
pub struct Args {
    /// Plan (JSON); several with --strip.
    #[arg(value_name = "PLAN.json", required = true)]
    plans: Vec<PathBuf>,
    /// Draw the robot itself instead, at six moments of each plan.
    #[arg(long)]
    strip: bool,
    /// Where to write the figure.
    #[arg(short, long, value_name = "FILE.svg")]
    output: PathBuf,
}

/// Runs the subcommand.
pub fn run(args: &Args) -> miette::Result<Exit> {
    files::ending(&args.output, "a figure", &["svg"])?;
    let plans: Vec<Plan> =
        args.plans.iter().map(|path| inputs::plan(path)).collect::<miette::Result<_>>()?;
    let svg = match &plans[..] {
        plans if args.strip => plot::strip(&plans.iter().collect::<Vec<_>>(), STRIP_MOMENTS),
        [plan] => plot::figure(plan),
        _ => {
            return Err(miette::miette!(
                help = "draw one at a time, or add --strip",
                "{} plans do not fit into one figure",
                plans.len()
            ));
        }
    };
    let place = Output::at(&args.output)?;
    place.write(svg.as_bytes())?;
    place.comment(&format!("wrote {}", args.output.display()))?;
    Ok(Exit::Ok)
}
