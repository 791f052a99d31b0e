//! `rollwalk export`: a plan at any rate, as a table for other programs.

use crate::files::{self, Output};
use crate::{Exit, inputs};
use clap::ValueEnum;
use miette::{IntoDiagnostic, miette};
use rollwalk_planner::export::Table;
use std::path::PathBuf;

/// Write a plan at any rate as CSV or JSON.
///
/// Values are instantaneous and come from the splines that the motion library is sampled from; every
/// column carries its unit in its name.
#[derive(clap::Args)]
#[command(after_long_help = "\
Examples:
  rollwalk export walk.plan.json --rate 60 --format csv -o walk.csv
  rollwalk export walk.plan.json --rate 500 --format json -o walk.500hz.json

The columns are described in docs/plan-format.md.")]
pub struct Args {
    /// Plan (JSON).
    #[arg(value_name = "PLAN.json")]
    plan: PathBuf,
    /// Rows per second.
    #[arg(long, value_name = "HZ", allow_negative_numbers = true, default_value_t = 60.0)]
    rate: f64,
    /// Form of the table [default: that of the ending of FILE, else csv].
    #[arg(long, value_enum)]
    format: Option<Format>,
    /// Where to write the table.
    #[arg(short, long, value_name = "FILE")]
    output: PathBuf,
}

#[derive(Clone, Copy, PartialEq, Eq, ValueEnum)]
enum Format {
    /// Comma-separated values with a header line.
    Csv,
    /// One JSON object: names of the columns, then one array for each row.
    Json,
}

/// Runs the subcommand.
pub fn run(args: &Args) -> miette::Result<Exit> {
    let format = format(args)?;
    let table = Table::new(&inputs::plan(&args.plan)?, args.rate).into_diagnostic()?;
    let text = match format {
        Format::Csv => table.to_csv(),
        Format::Json => table.to_json(),
    };
    let place = Output::at(&args.output)?;
    place.write(text.as_bytes())?;
    place.comment(&format!(
        "wrote {}: {} rows of {} columns at {} Hz",
        args.output.display(),
        table.rows.len(),
        table.columns.len(),
        table.rate_hz
    ))?;
    Ok(Exit::Ok)
}

/// Format of the table: that of `--format`, otherwise that of the file's extension.
fn format(args: &Args) -> miette::Result<Format> {
    let ending = match files::ending(&args.output, "a table", &["csv", "json"])? {
        Some("csv") => Some(Format::Csv),
        Some(_) => Some(Format::Json),
        None => None,
    };
    match (args.format, ending) {
        (Some(format), Some(ending)) if format != ending => Err(miette!(
            help = "leave --format out, or give another name",
            "the name {} is not that of the --format",
            args.output.display()
        )),
        (format, ending) => Ok(format.or(ending).unwrap_or(Format::Csv)),
    }
}
