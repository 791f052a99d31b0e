//! `rollwalk identify`: fits parameters of a robot file to recorded runs.

mod document;
mod outcome;
mod recorded;
mod report;
mod runs;
mod source;

use document::Document;
use indicatif::ProgressBar;
use miette::{Report, miette};
use outcome::{IdentificationOutcome, RejectedRun};
use rollwalk_robot::Robot;
use rollwalk_simulate::identify::{FitError, Kind, Quantity, Stage};
use rollwalk_terminal::files::{self, Output};
use rollwalk_terminal::inputs::Source as Inputs;
use rollwalk_terminal::progress::Lines;
use rollwalk_terminal::{Exit, interrupt, output};
use source::Source;
use std::path::PathBuf;

/// Fit friction, gains and masses of a robot file to recorded runs.
///
/// A run is simulated with the commands that its drives received, and the parameters of the robot are changed until the
/// simulation reproduces the recording. This uses the Gauss–Newton method with derivatives of the whole run (thesis 4.7.3). It
/// fits the beginning of the run first, then all but its last quarter, which is simulated as a check. Parameters that the run
/// does not determine keep their values.
///
/// Several runs are first fitted separately. Their disagreement reveals model errors that no single run shows, such as in the
/// slip of contacts. The robot file gets the mean of the runs, and the deviations include the spread between them.
#[derive(clap::Args)]
#[command(after_long_help = "\
Examples:
  rollwalk identify slalom.csv walk.csv step.csv --robot robots/agilebot.toml -o fitted.toml
  rollwalk identify slalom.csv walk.csv --from 0.3 --from 2 --robot robots/agilebot.toml -o fitted.toml
  rollwalk identify run.csv --robot robots/agilebot.toml --fit friction,kp,mass.body -o fitted.toml
  rollwalk identify run.csv --robot robots/agilebot.toml -o fitted.toml --predict walk.csv --predict trot.csv
  rollwalk identify run.mcap --robot robots/agilebot.toml --fit kp,kd,delay -o fitted.toml

What can be fitted, and what a recording needs: docs/identification.md")]
pub struct Args {
    /// Recorded runs of the robot, preferably of three motions or more, with the commands of its drives: telemetry of `rollwalk
    /// monitor --mcap`, a log of all actuator buses in candump's format, a log of the simulated world, or a table with some of
    /// its columns.
    #[arg(value_name = "RUN", required = true)]
    runs: Vec<PathBuf>,
    /// Robot file (TOML) with the initial values.
    #[arg(long, value_name = "ROBOT.toml")]
    robot: PathBuf,
    /// Parameters to fit: `friction`, `kp`, `kd` and so on, or those of one drive or link, such as `kp.xm540` [default:
    /// friction, resistance, kp, kd, stiffness, stick, delay].
    #[arg(long, value_name = "NAME,...", value_delimiter = ',')]
    fit: Vec<String>,
    /// Other run of the robot that is not fitted: it is simulated with the original and with the fitted values, and compared.
    /// May be given several times.
    #[arg(long, value_name = "RUN")]
    predict: Vec<PathBuf>,
    /// Output robot file, with the fitted values.
    #[arg(short, long, value_name = "FITTED.toml")]
    output: PathBuf,
    /// Ignore rows before this time of a recording, s: once for all runs, or once for each run, in their order.
    #[arg(long, value_name = "SECONDS")]
    from: Vec<f64>,
    /// Ignore rows after this time, s: once for all runs, or once for each run, in their order.
    #[arg(long, value_name = "SECONDS")]
    to: Vec<f64>,
    /// Print as JSON.
    #[arg(long)]
    json: bool,
}

/// Runs the subcommand.
pub fn run(args: &Args) -> miette::Result<Exit> {
    let (robot, text) = Inputs::Disk.robot_and_text(&args.robot)?;
    let mut source = Source::new(&args.robot, &text.text, &robot)?;
    let quantities = chosen(&source.quantities(&robot), &args.fit, &robot)?;
    files::ending(&args.output, "a robot file", &["toml"])?;
    let runs = runs::read(&args.runs, &robot, &args.from, &args.to)?;
    let others = runs::read_others(&args.predict, &robot)?;
    let place = Output::of_source(&args.output)?;
    interrupt::install_handler();
    let (bar, lines) = (ProgressBar::new_spinner(), Lines::begin());
    let watch = |run: &str, stage: &Stage| {
        let Stage { what, horizon_s, rollouts } = stage;
        let at = format!("{run}: {what}, {horizon_s:.1} s, rollout {rollouts}");
        lines.print(&at);
        bar.set_message(at);
        bar.tick();
        !interrupt::requested()
    };
    let outcome = IdentificationOutcome::new(&robot, &quantities, runs, others, watch);
    bar.finish_and_clear();
    let outcome = match outcome {
        Ok(outcome) => outcome,
        Err(RejectedRun { reason: FitError::Ended, .. }) => return Ok(Exit::Interrupted),
        Err(unfitted) => return Err(unfit(&unfitted)),
    };
    for of in &outcome.together.combined {
        source.set(&of.found, &outcome.names(of).join(", "));
    }
    let text = source.text();
    // Results that a robot file cannot have are also printed.
    if args.json {
        output::print_json(&Document::new(&outcome))?;
    } else {
        place.comment(&report::describe(&outcome))?;
    }
    Robot::from_toml(&args.output.display().to_string(), &text).map_err(Report::new)?;
    place.write(text.as_bytes())?;
    if !args.json {
        place.comment(&format!("wrote {}", args.output.display()))?;
    }
    Ok(Exit::Ok)
}

fn unfit(RejectedRun { path, reason }: &RejectedRun) -> Report {
    let path = path.display();
    let help = match reason {
        FitError::Soft(_) => {
            "leave out this quantity: --fit mass.LINK fits the masses of single links"
        }
        FitError::Falls(_) => {
            "give the robot file of this run, and a run on level ground; with `--from`, start \
             while the robot stands still"
        }
        _ => "record a longer run, or use a longer time span with `--from` and `--to`",
    };
    miette!(help = help, "{path}: {reason}")
}

/// Quantities with the given names, or the default ones if `names` is empty.
fn chosen(known: &[Quantity], names: &[String], robot: &Robot) -> miette::Result<Vec<Quantity>> {
    if names.is_empty() {
        return Ok(known.iter().filter(|of| of.kind.by_default()).cloned().collect());
    }
    for name in names {
        if known.iter().any(|of| is_named(of, name)) {
            continue;
        }
        let all: Vec<String> = known.iter().map(Quantity::name).collect();
        let help = format!("for {}, give {}", robot.name, all.join(", "));
        let kind = Kind::all().find(|kind| kind.name() == name);
        return Err(match kind.and_then(Kind::key) {
            Some(key) => miette!(
                help = help,
                "--fit {name}: no `{key}` in the robot file is above 0, so none can be fitted"
            ),
            None => miette!(help = help, "--fit {name}: there is no quantity with this name"),
        });
    }
    let is_wanted = |of: &&Quantity| names.iter().any(|name| is_named(of, name));
    Ok(known.iter().filter(is_wanted).cloned().collect())
}

fn is_named(of: &Quantity, name: &str) -> bool {
    of.kind.name() == name || of.name() == name
}
