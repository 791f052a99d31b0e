//! `rollwalk design check`: checks and prints the parameters of a design.

use super::read;
use rollwalk_design::designed::Designed;
use rollwalk_robot::document::DocumentError;
use rollwalk_terminal::Exit;
use rollwalk_terminal::output::{self, Table};
use serde::Serialize;
use std::path::PathBuf;

/// Check a design file and print its parameters.
///
/// Also tries each parameter alone at both of its bounds, and reports the bounds at which the robot file breaks a rule.
#[derive(clap::Args)]
#[command(after_long_help = "\
Examples:
  rollwalk design check designs/agilebot_legs.toml

The format is described in docs/design.md.")]
pub struct Args {
    /// Design file (TOML).
    #[arg(value_name = "DESIGN.toml")]
    design: PathBuf,
    /// Print as JSON.
    #[arg(long)]
    json: bool,
}

/// Parameter in the output of `--json`.
#[derive(Serialize)]
struct Parameter<'a> {
    name: &'a str,
    value: f64,
    min: f64,
    max: f64,
    step: Option<f64>,
    unit: &'static str,
    changes: String,
    /// Problems of the robot at the bounds of the parameter.
    problems: Vec<String>,
}

/// Runs the subcommand.
pub fn run(args: &Args) -> miette::Result<Exit> {
    let designed = read(&args.design)?;
    let parameters: Vec<Parameter> =
        (0..designed.original().len()).map(|index| parameter(&designed, index)).collect();
    if args.json {
        output::print_json(&parameters)?;
        return Ok(Exit::Ok);
    }
    let mut table = Table::new(["parameter", "now", "least", "most", "step", "unit", "changes"]);
    for of in &parameters {
        // The square root of a length that is not along an axis has many digits.
        let number = |value: f64| ((value * 1e6).round() / 1e6).to_string();
        table.row([
            of.name.to_owned(),
            number(of.value),
            number(of.min),
            number(of.max),
            of.step.map_or("any".to_owned(), number),
            of.unit.to_owned(),
            of.changes.clone(),
        ]);
    }
    let motions: Vec<&str> =
        designed.file.motions.iter().map(|motion| motion.file.as_str()).collect();
    let motions = match &motions[..] {
        [] => "no motions".to_owned(),
        motions => format!("motions: {}", motions.join(", ")),
    };
    output::print(&format!(
        "{} of {}\n{}\n{motions}",
        designed.file.name,
        designed.file.robot,
        table.render()
    ))?;
    if let Some(beyond) = designed.beyond() {
        output::print_line(format_args!("warning: original robot: {}", problems(beyond)));
    }
    for problem in parameters.iter().flat_map(|of| &of.problems) {
        output::print_line(problem);
    }
    Ok(Exit::Ok)
}

fn parameter(designed: &Designed, index: usize) -> Parameter<'_> {
    let of = &designed.file.parameters[index];
    let unit = of.place.kind.unit().0;
    let at = |value: f64| {
        let mut values = designed.original().to_vec();
        values[index] = value;
        let error = designed.at(&values).err()?;
        Some(format!("warning: at {} = {value} {unit}: {}", of.name, problems(&error)))
    };
    Parameter {
        name: &of.name,
        value: designed.original()[index],
        min: of.min,
        max: of.max,
        step: of.step,
        unit,
        changes: of.place.to_string(),
        problems: [of.min, of.max].into_iter().filter_map(at).collect(),
    }
}

/// Faults of a robot file, with their remedies.
fn problems(error: &DocumentError) -> String {
    let faults = error.faults().map(|fault| format!("{fault}: {}", fault.help));
    faults.collect::<Vec<_>>().join("; ")
}
