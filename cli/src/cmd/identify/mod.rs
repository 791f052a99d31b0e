//! `rollwalk identify`: fits the numbers of a robot file to a recorded run.

mod recorded;
mod report;
mod source;

use crate::files::{self, Output};
use crate::inputs::Source as Inputs;
use crate::{Exit, interrupt, output};
use indicatif::ProgressBar;
use miette::{Report, miette};
use report::{Document, Prediction};
use rollwalk_robot::Robot;
use rollwalk_simulate::identify::{
    Kind, Model, Options, Quantity, Stage, Unfit, identify, predict,
};
use source::Source;
use std::path::{Path, PathBuf};

/// Fit friction, gains and masses of a robot file to a recorded run.
///
/// The run is simulated again with what its drives were commanded, and the numbers of the robot change until the simulated robot does what
/// the recorded one did: by Gauss–Newton's method with derivatives of the whole run (thesis 4.7.3), first over its beginning, then over all of it
/// but the last quarter, which is simulated as a check. Parameters that the run does not determine keep their values.
#[derive(clap::Args)]
#[command(after_long_help = "\
Examples:
  rollwalk identify run.csv --robot robots/agilebot.toml -o fitted.toml
  rollwalk identify run.csv --robot robots/agilebot.toml --fit friction,kp,mass.body -o fitted.toml
  rollwalk identify run.csv --robot robots/agilebot.toml -o fitted.toml --predict walk.csv --predict trot.csv
  rollwalk identify run.mcap --robot robots/agilebot.toml --fit kp,kd,delay -o fitted.toml

What can be fitted, and what a recording needs: docs/identification.md")]
pub struct Args {
    /// Recorded run: telemetry of `rollwalk monitor --mcap`, a log of all actuator buses in candump's format, a log of the simulated world, or a table with
    /// some of its columns.
    #[arg(value_name = "RUN")]
    run: PathBuf,
    /// Robot file (TOML) to begin with.
    #[arg(long, value_name = "ROBOT.toml")]
    robot: PathBuf,
    /// What is fitted: `friction`, `kp`, `kd` and so on, or of one drive or link, such as `kp.xm540` [default: friction, resistance, kp, kd, stiffness, stick, delay].
    #[arg(long, value_name = "NAME,...", value_delimiter = ',')]
    fit: Vec<String>,
    /// Another run of the robot, which takes no part: it is simulated with the numbers of the file and with those found, and compared. As often as wanted.
    #[arg(long, value_name = "RUN")]
    predict: Vec<PathBuf>,
    /// Robot file to write, with the fitted values.
    #[arg(short, long, value_name = "FITTED.toml")]
    output: PathBuf,
    /// Leave out rows before this time of the recording, s.
    #[arg(long, value_name = "SECONDS")]
    from: Option<f64>,
    /// Leave out rows after this time of the recording, s.
    #[arg(long, value_name = "SECONDS")]
    to: Option<f64>,
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
    let recording = recorded::read(&args.run, &robot, [args.from, args.to])?;
    let mut others = Vec::new();
    for path in &args.predict {
        others.push((path, recorded::read(path, &robot, [None; 2])?));
    }
    let place = Output::of_source(&args.output)?;
    interrupt::listen();
    let bar = ProgressBar::new_spinner();
    let watch = |stage: &Stage| {
        let Stage { what, horizon_s, rollouts } = stage;
        bar.set_message(format!("{what}, {horizon_s:.1} s, rollout {rollouts}"));
        bar.tick();
        !interrupt::requested()
    };
    let options = Options::default();
    let all = || -> Result<_, (Unfit, &PathBuf)> {
        let found = identify(&robot, recording, &quantities, &options, watch);
        let found = found.map_err(|reason| (reason, &args.run))?;
        let file = Model::new(&robot);
        let mut predicted = Vec::new();
        for (path, other) in others {
            let with = |model| {
                predict(model, other.clone(), &options, watch).map_err(|reason| (reason, path))
            };
            predicted
                .push(Prediction { run: name_of(path), of: [with(&file)?, with(&found.model)?] });
        }
        Ok((found, predicted))
    };
    let all = all();
    bar.finish_and_clear();
    let (found, predicted) = match all {
        Ok(all) => all,
        Err((Unfit::Ended, _)) => return Ok(Exit::Interrupted),
        Err((reason, path)) => return Err(unfit(&reason, path)),
    };
    let run = name_of(&args.run);
    found.found.iter().for_each(|of| source.set(of, &run));
    let text = source.text();
    // Also what no robot file may have is worth knowing.
    if args.json {
        output::print_json(&Document::new(&run, &found, &predicted))?;
    } else {
        place.comment(&report::describe(&run, &found, &predicted))?;
    }
    Robot::from_toml(&args.output.display().to_string(), &text).map_err(Report::new)?;
    place.write(text.as_bytes())?;
    if !args.json {
        place.comment(&format!("wrote {}", args.output.display()))?;
    }
    Ok(Exit::Ok)
}

/// A file without its folder: robot files travel.
fn name_of(path: &Path) -> String {
    path.file_name().unwrap_or_default().to_string_lossy().into_owned()
}

fn unfit(reason: &Unfit, path: &Path) -> Report {
    let path = path.display();
    let help = match reason {
        Unfit::Soft(_) => "leave it out: --fit mass.LINK has the masses of some links only",
        Unfit::Falls(_) => {
            "is this its robot file, and is the ground level? `--from` begins where the robot stands still"
        }
        _ => "record more, or leave out less with `--from` and `--to`",
    };
    miette!(help = help, "{path}: {reason}")
}

/// Quantities by name; those that are fitted when nothing is said, without names.
fn chosen(known: &[Quantity], names: &[String], robot: &Robot) -> miette::Result<Vec<Quantity>> {
    if names.is_empty() {
        return Ok(known.iter().filter(|of| of.kind.by_default()).cloned().collect());
    }
    for name in names {
        if known.iter().any(|of| is_named(of, name)) {
            continue;
        }
        let all: Vec<String> = known.iter().map(Quantity::name).collect();
        let help = format!("{} has {}", robot.name, all.join(", "));
        let kind = Kind::all().find(|kind| kind.name() == name);
        return Err(match kind.and_then(Kind::key) {
            Some(key) => miette!(
                help = help,
                "--fit {name}: the robot file has no `{key}` above 0 that could change"
            ),
            None => miette!(help = help, "--fit {name}: there is nothing of this name"),
        });
    }
    let is_wanted = |of: &&Quantity| names.iter().any(|name| is_named(of, name));
    Ok(known.iter().filter(is_wanted).cloned().collect())
}

fn is_named(of: &Quantity, name: &str) -> bool {
    of.kind.name() == name || of.name() == name
}
