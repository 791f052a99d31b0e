//! `rollwalk robot check`: is a robot file right, and what does it describe? And the other commands
//! about robot files.

use super::draw;
use super::import;
use super::robot_export;
use super::standing::StandingReport;
use crate::buses::BusLoads;
use miette::IntoDiagnostic;
use rollwalk_robot::{Actuator, Robot};
use rollwalk_terminal::inputs::Source;
use rollwalk_terminal::output::Table;
use rollwalk_terminal::{Exit, output};
use serde::Serialize;
use std::fmt::Write;
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

fn check(check: &Check) -> miette::Result<Exit> {
    let robot = Source::Disk.robot(&check.robot)?;
    let buses = BusLoads::new(&robot).into_diagnostic()?;
    let standing = StandingReport::new(&robot);
    let flat = || {
        vec!["a wheel lies flat in the nominal pose: check `axis_in_link` of the wheels, and `nominal_rad` of the joints that turn them".to_owned()]
    };
    let mut warnings = standing.as_ref().map_or_else(flat, |s| s.warnings().to_vec());
    warnings.extend(buses.warnings());
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

/// Describes the robot as text: tree, joints, end effectors.
pub(super) fn describe(robot: &Robot) -> String {
    let wheels = robot.end_effectors.iter().filter(|e| e.contact.rolls()).count();
    let mut text = format!(
        "{}: {:.3} kg, {} links, {} joints, {} wheels, {} feet\n\n",
        robot.name,
        robot.total_mass_kg(),
        robot.links.len(),
        robot.joints.len(),
        wheels,
        robot.end_effectors.len() - wheels,
    );
    branch(robot, 0, "", &mut text);

    let mut joints = Table::new([
        "joint",
        "min rad",
        "max rad",
        "nominal rad",
        "rad/s",
        "N·m",
        "servo",
        "bus:id",
    ]);
    for joint in &robot.joints {
        let Actuator { model, speed_max_rad_s, torque_max_nm, bus, id, .. } = &joint.actuator;
        joints.row([
            joint.name.clone(),
            format!("{:.3}", joint.position_min_rad),
            format!("{:.3}", joint.position_max_rad),
            format!("{:.3}", joint.nominal_rad),
            format!("{speed_max_rad_s:.2}"),
            format!("{torque_max_nm:.2}"),
            model.clone(),
            format!("{bus}:{id}"),
        ]);
    }
    let _ = writeln!(text, "\n{}", joints.render());

    let mut contacts = Table::new([
        "end effector",
        "kind",
        "radius m",
        "friction",
        "rad/s",
        "N·m",
        "motor",
        "bus:id",
    ]);
    for end in &robot.end_effectors {
        let motor = end.contact.actuator();
        let of_motor = |show: &dyn Fn(&Actuator) -> String| motor.map_or("–".into(), show);
        contacts.row([
            end.name.clone(),
            end.contact.kind().into(),
            format!("{:.4}", end.radius_m),
            format!("{:.2}", end.friction_coefficient),
            of_motor(&|motor| format!("{:.2}", motor.speed_max_rad_s)),
            of_motor(&|motor| format!("{:.2}", motor.torque_max_nm)),
            of_motor(&|motor| motor.model.clone()),
            of_motor(&|motor| format!("{}:{}", motor.bus, motor.id)),
        ]);
    }
    let _ = write!(text, "\n{}", contacts.render());
    text
}

/// Draws `link` with the links below it.
fn branch(robot: &Robot, link: usize, indent: &str, text: &mut String) {
    let _ = writeln!(text, "{} ({:.3} kg)", robot.links[link].name, robot.links[link].mass_kg);
    let joints: Vec<_> = robot.joints.iter().filter(|joint| joint.parent == link).collect();
    let ends: Vec<_> = robot.end_effectors.iter().filter(|end| end.link == link).collect();
    let count = joints.len() + ends.len();
    for (number, end) in ends.iter().enumerate() {
        let fork = if number + 1 == count { "└─" } else { "├─" };
        let _ = writeln!(text, "{indent}{fork} {}", end.name);
    }
    for (number, joint) in joints.iter().enumerate() {
        let last = ends.len() + number + 1 == count;
        let (fork, rail) = if last { ("└─", "   ") } else { ("├─", "│  ") };
        let _ = write!(text, "{indent}{fork} {} → ", joint.name);
        branch(robot, joint.child, &format!("{indent}{rail}"), text);
    }
}
