//! `rollwalk plan`: optimises a motion.

use crate::planning::shortfall;
use crate::progress::{Watch, words};
use crate::{Exit, files, inputs, interrupt, output, race};
use miette::IntoDiagnostic;
use rollwalk_planner::plan::{Plan, Status};
use rollwalk_planner::start::{Start, StartKind, Started, WarmStart};
use rollwalk_planner::{Method, Options, replan};
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
  rollwalk plan motions/walk.toml -o walk.plan.json --seed 3
  rollwalk plan faster.toml -o faster.plan.json --from walk.plan.json

The format is described in docs/motion-files.md.")]
pub struct Args {
    /// Motion file (TOML).
    #[arg(value_name = "MOTION.toml")]
    motion: PathBuf,
    /// Where to write the plan.
    #[arg(short, long, value_name = "PLAN.json")]
    output: PathBuf,
    /// Where to start.
    #[arg(long, value_enum, default_value_t)]
    start: Choice,
    /// Seed of everything random in the start; the same seed gives the same plan.
    #[arg(long, value_name = "N", default_value_t = 0)]
    seed: u64,
    /// Start from this plan of a similar motion, such as the same one before an edit.
    #[arg(long, value_name = "PLAN.json", conflicts_with_all = ["start", "seed"])]
    from: Option<PathBuf>,
    /// How to minimise; the others are the thesis's, for comparison, and much slower.
    #[arg(long, value_enum, default_value_t)]
    method: MethodChoice,
    /// Print every iteration to stderr.
    #[arg(short, long)]
    verbose: bool,
    /// Print the outcome as JSON.
    #[arg(long)]
    json: bool,
}

/// Where a solve can start.
#[derive(Clone, Copy, Debug, Default, clap::ValueEnum)]
enum Choice {
    /// What suits the motion, several starts at once if there are cores for them
    #[default]
    Auto,
    /// Standing, carried along the way to the goal
    Standing,
    /// Standing with a smooth random swing of every joint
    Sinusoid,
    /// The thesis's warm start: stand, sway, step in place
    Warm,
}

impl From<Choice> for Start {
    fn from(choice: Choice) -> Self {
        match choice {
            Choice::Auto => Self::Auto,
            Choice::Standing => Self::Standing,
            Choice::Sinusoid => Self::Sinusoid,
            Choice::Warm => Self::Warm(WarmStart::default()),
        }
    }
}

/// How a solve can go.
#[derive(Clone, Copy, Debug, Default, clap::ValueEnum)]
enum MethodChoice {
    /// Gauss-Newton with multipliers
    #[default]
    GaussNewton,
    /// Newton with a penalty of 10000, without the second derivatives of consistency constraints
    NewtonFiltered,
    /// Newton with a penalty of 10000 and the true Hessian
    NewtonTrue,
    /// L-BFGS with a penalty of 10000
    Lbfgs,
}

impl From<MethodChoice> for Method {
    fn from(choice: MethodChoice) -> Self {
        match choice {
            MethodChoice::GaussNewton => Self::GaussNewton,
            MethodChoice::NewtonFiltered => Self::NewtonFiltered,
            MethodChoice::NewtonTrue => Self::NewtonTrue,
            MethodChoice::Lbfgs => Self::Lbfgs,
        }
    }
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
    start: Started,
    /// Null after an interrupt.
    plan: Option<&'a PathBuf>,
}

/// Runs the subcommand.
pub fn run(args: &Args) -> miette::Result<Exit> {
    let (robot, motion) = inputs::Source::Disk.motion(&args.motion)?;
    let previous = args.from.as_deref().map(inputs::plan).transpose()?;
    files::prepare(files::folder(&args.output))?;
    interrupt::listen();
    let mut options = Options { start: args.start.into(), seed: args.seed, ..Options::default() };
    options.settings.method = args.method.into();
    let watch = Watch::start(&motion.name, args.verbose);
    let plan = match previous {
        Some(previous) => {
            let progress = &mut |progress: &_| watch.iteration(progress);
            replan(&previous, &robot, &motion, &options, progress).into_diagnostic()?
        }
        None => race::optimise_any(&robot, &motion, &options, &|state| watch.iteration(state)),
    };
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
        start: plan.solve.start,
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
        "{} on {}: {} after {} iterations from {}, {time_s:.2} s\n\
         the centre of mass moves {} m in x and {} m in y, turns {} rad, in {:.2} s\n\
         {}\n{}",
        plan.motion.name,
        plan.robot.name,
        words(solve.status),
        solve.iterations,
        beginning(solve.start),
        millis(last[0] - first[0]),
        millis(last[1] - first[1]),
        millis(last_yaw - first_yaw),
        plan.motion.duration_s,
        match solve.status {
            Status::Infeasible | Status::Stalled | Status::IterationLimit => shortfall(solve),
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

/// Where a solve started, in words.
fn beginning(start: Started) -> String {
    let kind = match start.kind {
        StartKind::Standing => "standing",
        StartKind::Sinusoid => "a random swing",
        StartKind::Warm => "the warm start",
        StartKind::Neighbour => return "the given plan".to_owned(),
        StartKind::Joined => return "the motions it joins".to_owned(),
    };
    format!("{kind}, seed {}", start.seed)
}

/// A signed number with three decimals, without the minus sign of a rounded zero.
fn millis(value: f64) -> String {
    format!("{:+.3}", (value * 1e3).round() / 1e3 + 0.0)
}
