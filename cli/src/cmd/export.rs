//! `rollwalk export`: writes a plan at any rate, for other programs.

use clap::ValueEnum;
use miette::{IntoDiagnostic, miette};
use rollwalk_planner::export::{Length, Rate, Table};
use rollwalk_planner::plan::Plan;
use rollwalk_terminal::files::{self, Output};
use rollwalk_terminal::{Exit, inputs};
use std::path::PathBuf;

/// Write a plan at any rate: as a table (CSV, JSON), for MuJoCo, Foxglove, ROS or learning.
///
/// Values are instantaneous and come from the splines from which the motion library is sampled. Every column of a table has its
/// unit in its name.
#[derive(clap::Args)]
#[command(after_long_help = "\
Examples:
  rollwalk export walk.plan.json --rate 60 --format csv -o walk.csv
  rollwalk export walk.plan.json --rate 500 --format json -o walk.500hz.json
  rollwalk export walk.plan.json -o walk.mcap                        for Foxglove or Lichtblick
  rollwalk export walk.plan.json -o walk.xml                         for MuJoCo, with controls that play it
  rollwalk export walk.plan.json --format ros -o walk.ros.json       a moveit_msgs/RobotTrajectory
  rollwalk export walk.plan.json --rate 50 --length 10 -o walk.npz   for learning, with NumPy

The columns of tables are described in docs/formats/plan-format.md, arrays in docs/training-data.md, the other formats in docs/exports.md.")]
pub struct Args {
    /// Plan (JSON).
    #[arg(value_name = "PLAN.json")]
    plan: PathBuf,
    /// Rows or frames per second.
    #[arg(long, value_name = "HZ", default_value_t = 60.0)]
    rate: f64,
    /// Length of the motion data (.npz), s: a periodic motion repeats [default: the duration of the plan].
    #[arg(long, value_name = "S")]
    length: Option<f64>,
    /// Format [default: by the extension of FILE, else csv].
    #[arg(long, value_enum)]
    format: Option<Format>,
    /// Output file: .csv, .json, .mcap, .npz, or .xml for MJCF.
    #[arg(short, long, value_name = "FILE")]
    output: PathBuf,
}

#[derive(Clone, Copy, PartialEq, Eq, ValueEnum)]
enum Format {
    /// Table as comma-separated values with a header line.
    Csv,
    /// Table as one JSON object: names of the columns, then one array for each row.
    Json,
    /// Recording for Foxglove and Lichtblick: frames, solids, joint states, ground forces.
    Mcap,
    /// Model for MuJoCo with the plan as keyframes; their controls play the plan.
    Mjcf,
    /// Motion data for learning: arrays of NumPy.
    Npz,
    /// Message moveit_msgs/RobotTrajectory as JSON: joints, driven wheels and body.
    Ros,
}

impl Format {
    /// Formats in order of preference. An extension selects the first format that uses it.
    const ALL: [Self; 6] = [Self::Csv, Self::Json, Self::Mcap, Self::Mjcf, Self::Npz, Self::Ros];

    fn ending(self) -> &'static str {
        match self {
            Self::Csv => "csv",
            Self::Json | Self::Ros => "json",
            Self::Mcap => "mcap",
            Self::Mjcf => "xml",
            Self::Npz => "npz",
        }
    }

    /// True if frames are at multiples of the requested rate.
    fn is_at_multiples(self) -> bool {
        matches!(self, Self::Csv | Self::Json | Self::Npz)
    }

    fn write(self, plan: &Plan, rate: Rate, length: Option<Length>) -> miette::Result<Vec<u8>> {
        let duration_s = covered_s(plan, length);
        let table = || {
            let table = Table::new(plan, rate);
            if table.rows.len() < 2 { Err(too_slow(duration_s)) } else { Ok(table) }
        };
        Ok(match self {
            Self::Csv => table()?.to_csv().into_bytes(),
            Self::Json => table()?.to_json().into_bytes(),
            Self::Mcap => {
                rollwalk_interchange::foxglove::recording(plan, rate).into_diagnostic()?
            }
            Self::Mjcf => rollwalk_interchange::motion(plan, rate).into_diagnostic()?.into_bytes(),
            Self::Npz => {
                if rate.hz() * duration_s < 1.0 {
                    return Err(too_slow(duration_s));
                }
                rollwalk_interchange::motion_data(plan, rate, length).into_diagnostic()?
            }
            Self::Ros => rollwalk_interchange::trajectory(plan, rate).into_bytes(),
        })
    }
}

/// Runs the subcommand.
pub fn run(args: &Args) -> miette::Result<Exit> {
    let format = format(args)?;
    let rate = Rate::new(args.rate).into_diagnostic()?;
    let length = args.length.map(Length::new).transpose().into_diagnostic()?;
    if length.is_some() && format != Format::Npz {
        return Err(miette!(
            help = "leave out --length, or write a file that ends in .npz",
            "--length is for motion data (.npz); other formats have the duration of the plan"
        ));
    }
    let plan = inputs::plan(&args.plan)?;
    let content = format.write(&plan, rate, length)?;
    let duration_s = covered_s(&plan, length);
    let place = Output::at(&args.output)?;
    place.write(&content)?;
    let output = args.output.display();
    // Other formats have evenly spaced frames.
    let rate_hz = if format.is_at_multiples() {
        args.rate
    } else {
        (rate.even_hz(duration_s) * 1e6).round() / 1e6
    };
    place.comment(&format!("wrote {output}: {duration_s} s at {rate_hz} Hz"))?;
    Ok(Exit::Ok)
}

/// Duration of the exported motion, s.
fn covered_s(plan: &Plan, length: Option<Length>) -> f64 {
    length.map_or(plan.motion.duration_s, |length| length.of(&plan.motion))
}

/// Report of a rate that is so low that the output would have a single row or frame.
fn too_slow(duration_s: f64) -> miette::Report {
    miette!(
        help = "give --rate 60, the rate at which robots play",
        "--rate is too low: a motion of {duration_s} s would have fewer than two rows"
    )
}

/// Format of the output: that of `--format`, or else that of the file extension.
fn format(args: &Args) -> miette::Result<Format> {
    let ending = files::ending(&args.output, "a plan", &["csv", "json", "mcap", "npz", "xml"])?;
    let by_ending = Format::ALL.into_iter().find(|format| Some(format.ending()) == ending);
    match (args.format, ending) {
        (Some(format), Some(ending)) if format.ending() != ending => Err(miette!(
            help = format!("leave out --format, or give a name that ends in .{}", format.ending()),
            "the extension of {} does not match --format",
            args.output.display()
        )),
        (format, _) => Ok(format.or(by_ending).unwrap_or(Format::Csv)),
    }
}
