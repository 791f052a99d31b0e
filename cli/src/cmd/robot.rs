//! `rollwalk robot check`: is a robot file right, and what does it describe? And the other commands
//! about robot files.

use super::description::describe;
use super::draw;
use super::import;
use super::robot_export;
use super::standing::StandingReport;
use crate::buses::BusLoads;
use miette::IntoDiagnostic;
use rollwalk_robot::Robot;
use rollwalk_terminal::inputs::Source;
use rollwalk_terminal::{Exit, output};
use serde::Serialize;
use std::path::PathBuf;

/// Check and draw robot files, import them from URDF and MJCF, and export them for other tools.
#[derive(clap::Subcommand)]
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
struct Report<'a> {
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

/// Prints what `robot check` warns of, for commands that plan motions of the robot.
pub fn print_robot_warnings(robot: &Robot) {
    let buses = BusLoads::new(robot).ok();
    output::say_warnings(&warnings(StandingReport::new(robot).as_ref(), buses.as_ref()));
}

fn warnings(standing: Option<&StandingReport>, buses: Option<&BusLoads>) -> Vec<String> {
    let flat = || {
        vec!["a wheel lies flat in the nominal pose: check `axis_in_link` of the wheels, and `nominal_rad` of the joints that turn them".to_owned()]
    };
    let mut warnings = standing.map_or_else(flat, |s| s.warnings().to_vec());
    warnings.extend(buses.map(BusLoads::warnings).into_iter().flatten());
    warnings
}

fn check(check: &Check) -> miette::Result<Exit> {
    let robot = Source::Disk.robot(&check.robot)?;
    let buses = BusLoads::new(&robot).into_diagnostic()?;
    let standing = StandingReport::new(&robot);
    let warnings = warnings(standing.as_ref(), Some(&buses));
    if check.json {
        let mass_kg = robot.total_mass_kg();
        output::print_json(&Report { mass_kg, robot: &robot, standing })?;
    } else {
        let standing = standing.map_or(String::new(), |standing| standing.show());
        output::print(&format!("{}\n\n{standing}\n{}", describe(&robot), buses.table()))?;
    }
    output::say_warnings(&warnings);
    buses.check(&check.robot)?;
    Ok(Exit::Ok)
}
