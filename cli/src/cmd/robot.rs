//! `rollwalk robot check`: validates and describes a robot file. The other commands about robot files start here.

use super::description::describe;
use super::draw;
use super::import;
use super::robot_export;
use super::standing::StandingReport;
use crate::buses::BusLoads;
use crate::terrain::FEET_MIN;
use miette::IntoDiagnostic;
use rollwalk_robot::Robot;
use rollwalk_terminal::inputs::{Source, TextFile};
use rollwalk_terminal::{Exit, output};
use serde::Serialize;
use std::path::PathBuf;

/// Check and draw robot files, import them from URDF and MJCF, and export them for other tools.
#[derive(clap::Subcommand)]
#[command(after_long_help = "\
Examples:
  rollwalk robot check robots/agilebot.toml
  rollwalk robot draw robots/agilebot.toml -o agilebot.svg
  rollwalk robot import a1.urdf --template a1.side.toml
  rollwalk robot export robots/agilebot.toml -o agilebot.urdf")]
pub enum Action {
    Check(Check),
    Import(import::Args),
    Export(robot_export::Args),
    Draw(draw::Args),
}

/// Validate a robot file and print its tree, masses, limits and wheels, and how it stands: torques against limits, sag,
/// clearance.
#[derive(clap::Args)]
#[command(after_long_help = "\
Examples:
  rollwalk robot check robots/agilebot.toml
  rollwalk robot check my-robot.toml --json | jq .mass_kg

The format is described in docs/robot-files.md; robots/agilebot.toml is a worked example.")]
pub struct Check {
    /// Robot file (TOML).
    #[arg(value_name = "ROBOT.toml")]
    robot: PathBuf,
    /// Print the resolved robot as JSON instead.
    #[arg(long)]
    json: bool,
}

/// Output of `--json`.
#[derive(Serialize)]
struct RobotOutput<'a> {
    mass_kg: f64,
    robot: &'a Robot,
    standing: Option<StandingReport>,
}

/// Runs the subcommand.
pub fn run(action: &Action) -> miette::Result<Exit> {
    match action {
        Action::Check(args) => check(args),
        Action::Import(args) => import::run(args),
        Action::Export(args) => robot_export::run(args),
        Action::Draw(args) => draw::run(args),
    }
}

/// Prints the warnings of `robot check`, for commands that plan motions of the robot.
pub fn print_robot_warnings(robot: &Robot, text: &TextFile) {
    let buses = BusLoads::new(robot).ok();
    let standing = StandingReport::new(robot);
    output::print_warnings(&warnings(robot, text, standing.as_ref(), buses.as_ref()));
}

fn warnings(
    robot: &Robot,
    text: &TextFile,
    standing: Option<&StandingReport>,
    buses: Option<&BusLoads>,
) -> Vec<String> {
    let flat = || {
        vec!["a wheel lies flat in the nominal pose: check `axis_in_link` of the wheels, and `nominal_rad` of the joints that turn them".to_owned()]
    };
    let mut warnings = Robot::side_warnings(&text.path, &text.text);
    warnings.extend(robot.data_sheet_warnings());
    warnings.extend(standing.map_or_else(flat, |s| s.warnings().to_vec()));
    warnings.extend(buses.map(BusLoads::warnings).into_iter().flatten());
    warnings
}

/// Commands for a robot that falls without feedback; empty for others.
fn balance(robot: &Robot) -> String {
    if robot.end_effectors.len() >= FEET_MIN {
        return String::new();
    }
    let plans = match rollwalk_tracking::balances(robot) {
        true => "`rollwalk plan` works, and `rollwalk simulate` with --tracking; ",
        false => "",
    };
    format!(
        "\nbalance: {} feet and wheels do not hold the robot upright without feedback. {plans}`rollwalk demo` and `rollwalk-sim` need --on stand\n",
        robot.end_effectors.len()
    )
}

fn check(check: &Check) -> miette::Result<Exit> {
    let (robot, text) = Source::Disk.robot_and_text(&check.robot)?;
    let buses = BusLoads::new(&robot).into_diagnostic()?;
    let standing = StandingReport::new(&robot);
    let warnings = warnings(&robot, &text, standing.as_ref(), Some(&buses));
    if check.json {
        let mass_kg = robot.total_mass_kg();
        output::print_json(&RobotOutput { mass_kg, robot: &robot, standing })?;
    } else {
        let standing = standing.map_or(String::new(), |standing| standing.show());
        let balance = balance(&robot);
        output::print(&format!("{}\n\n{standing}{balance}\n{}", describe(&robot), buses.table()))?;
    }
    output::print_warnings(&warnings);
    buses.check(&check.robot)?;
    Ok(Exit::Ok)
}
