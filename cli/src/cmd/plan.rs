//! `rollwalk plan`: optimises a motion.

use crate::planning::shortfall;
use crate::progress::{Watch, words};
use crate::{Exit, files, inputs, interrupt, output};
use rollwalk_planner::plan::{Plan, Status};
use rollwalk_planner::{Options, optimise};
use serde::Serialize;
use std::path::PathBuf;

/// Optimise a motion and write the plan.
///
/// The motion file names its robot. The plan is written whether or not every constraint could be met,
/// so that it can be looked at; the exit code tells the two apart. After Ctrl-C nothing is written.
#[derive(clap::Args)]
#[command(after_long_help = "\
Examples:
  rollwalk plan motions/walk.toml -o walk.plan.json
  rollwalk plan motions/walk.toml -o walk.plan.json -v      every iteration
  rollwalk plan motions/walk.toml -o walk.plan.json --json | jq .iterations

The format is described in docs/motion-files.md.")]
pub struct Args {
    /// Motion file (TOML).
    #[arg(value_name = "MOTION.toml")]
    motion: PathBuf,
    /// Where to write the plan.
    #[arg(short, long, value_name = "PLAN.json")]
    output: PathBuf,
    /// Print every iteration to stderr.
    #[arg(short, long)]
    verbose: bool,
    /// Print the outcome as JSON.
    #[arg(long)]
    json: bool,
}

/// What `--json` prints.
#[derive(Serialize)]
struct Outcome<'a> {
    motion: &'a str,
    robot: &'a str,
    status: Status,
    iterations: usize,
    time_s: f64,
    energy: f64,
    worst_level: f64,
    worst_constraint: &'a str,
    /// Null after an interrupt.
    plan: Option<&'a PathBuf>,
}

/// Runs the subcommand.
pub fn run(args: &Args) -> miette::Result<Exit> {
    let (robot, motion) = inputs::Source::Disk.motion(&args.motion)?;
    files::prepare(files::folder(&args.output))?;
    interrupt::listen();
    let watch = Watch::start(&motion.name, args.verbose);
    let plan =
        optimise(&robot, &motion, &Options::default(), &mut |progress| watch.iteration(progress));
    let time_s = watch.finish().as_secs_f64();
    let exit = Exit::from(plan.solve.status);
    let written = (exit != Exit::Interrupted).then_some(&args.output);
    if let Some(path) = written {
        files::write(path, plan.to_json().as_bytes())?;
    }
    if args.json {
        output::print_json(&outcome(&plan, time_s, written))?;
    } else {
        output::print(&describe(&plan, time_s, written))?;
    }
    Ok(exit)
}

fn outcome<'a>(plan: &'a Plan, time_s: f64, written: Option<&'a PathBuf>) -> Outcome<'a> {
    Outcome {
        motion: &plan.motion.name,
        robot: &plan.robot.name,
        status: plan.solve.status,
        iterations: plan.solve.iterations,
        time_s,
        energy: plan.solve.energy,
        worst_level: plan.solve.worst_level,
        worst_constraint: &plan.solve.worst_constraint,
        plan: written,
    }
}

fn describe(plan: &Plan, time_s: f64, written: Option<&PathBuf>) -> String {
    let solve = &plan.solve;
    let first = &plan.samples[0].com_m;
    let last = &plan.after.com_m;
    let [first_yaw, last_yaw] =
        [&plan.samples[0], &plan.after].map(|sample| sample.base_yaw_pitch_roll_rad[0]);
    format!(
        "{} on {}: {} after {} iterations, {time_s:.2} s\n\
         the centre of mass moves {} m in x and {} m in y, turns {} rad, in {:.2} s\n\
         {}\n{}",
        plan.motion.name,
        plan.robot.name,
        words(solve.status),
        solve.iterations,
        millis(last[0] - first[0]),
        millis(last[1] - first[1]),
        millis(last_yaw - first_yaw),
        plan.motion.duration_s,
        match solve.status {
            Status::Infeasible | Status::IterationLimit => shortfall(solve),
            Status::Converged | Status::Interrupted => format!(
                "worst constraint: {}, at {:.3} of its credible level",
                solve.worst_constraint, solve.worst_level
            ),
        },
        match written {
            Some(path) if solve.status == Status::Converged => format!("wrote {}", path.display()),
            Some(path) => format!(
                "wrote {0}; `rollwalk report {0}` shows where it fails. A longer duration, a nearer \
                 goal or more samples may help",
                path.display()
            ),
            None => "nothing written".to_owned(),
        }
    )
}

/// A signed number with three decimals, without the minus sign of a rounded zero.
fn millis(value: f64) -> String {
    format!("{:+.3}", (value * 1e3).round() / 1e3 + 0.0)
}
