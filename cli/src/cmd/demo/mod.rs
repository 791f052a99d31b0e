//! `rollwalk demo`: the whole pipeline, from a robot file to a moving robot, without hardware.

mod outcome;
mod score;
mod table;
mod world;

use crate::cmd::plot::STRIP_MOMENTS;
use crate::terrain::{GroundArgs, Support};
use crate::tour;
use miette::IntoDiagnostic;
use outcome::DemoOutcome;
use rollwalk_bus::candump;
use rollwalk_planner::plot::{self, JointPanels};
use rollwalk_terminal::files::{self, file_name};
use rollwalk_terminal::inputs::{Library, Source};
use rollwalk_terminal::planning::{Plans, plan_all};
use rollwalk_terminal::validated_library::ValidatedLibrary;
use rollwalk_terminal::{Exit, interrupt, output, shipped};
use std::path::{Path, PathBuf};

/// Plan, pack, flash and play a motion library on a simulated robot, and measure every stage.
///
/// Every motion and every transition is optimised from scratch, packed into a motion library and transferred over a simulated
/// CAN bus to the controller's firmware. The robot is armed, each motion is selected by its command code, every transition of
/// the motion graph is played, and the robot returns to SAFE and is disarmed. The simulated robot is on the ground; with --on
/// stand it hangs on a stand. The tables compare plans with physics, commands on the bus with plans, motors with commands, and
/// the path of the robot on the ground with its plans. The exit code is 4 if a measured error exceeds its limit.
///
/// The library is that of AgileBot, embedded in the program, unless --library names another.
#[derive(clap::Args)]
#[command(after_long_help = "\
Examples:
  rollwalk demo --out demo-out
  rollwalk demo --library pup.library.toml --out pup-out
  rollwalk demo --slope 2 --push 20:0,15,0:0.1
  rollwalk demo --json | jq '.clips[] | {name, iterations, slip_mm_s}'

The folder then holds
  plans/*.json       one plan for each motion and transition
  plots/*.svg        one figure for each plan, and robot.svg, the robot in every motion
  ROBOT.rwl          the motion library
  bus.log            every frame of every CAN bus, as candump writes it
  serial.log         every packet of servos on serial lines, if the robot has any")]
pub struct Args {
    /// Folder for plans, plots, library and bus log. If it is missing, it is created in its parent folder, which must exist.
    /// Files in it are replaced.
    #[arg(long, value_name = "DIR", default_value = "demo-out")]
    out: PathBuf,
    /// Library file (TOML) to play instead of AgileBot's.
    #[arg(long, value_name = "LIBRARY.toml")]
    library: Option<PathBuf>,
    /// Support of the robot.
    #[arg(long, value_name = "SUPPORT", value_enum, default_value_t = Support::Ground)]
    on: Support,
    #[command(flatten)]
    ground: GroundArgs,
    /// Print every iteration to stderr.
    #[arg(short, long)]
    verbose: bool,
    /// Print the measurements as JSON.
    #[arg(long)]
    json: bool,
}

/// Runs the subcommand.
pub fn run(args: &Args) -> miette::Result<Exit> {
    let library = match &args.library {
        Some(path) => Source::Disk.library(path)?,
        None => Source::Shipped.library(Path::new(shipped::DEMO_LIBRARY))?,
    };
    let ground = args.ground.under(args.on, &library.robot)?;
    files::make_folder(&args.out)?;
    for folder in ["plans", "plots"] {
        files::make_folder(&args.out.join(folder))?;
    }
    output::print_line(format_args!(
        "Planning {}: {} motions, {} transitions, each from scratch",
        library.robot.name,
        library.motions.len(),
        library.file.transitions.len()
    ));
    let Some(plans) = plan_all(&library, args.verbose)? else { return Ok(Exit::Interrupted) };
    write_plans(&args.out, &plans)?;
    let failures = plans.failures();
    if !failures.is_empty() {
        let out = args.out.display();
        output::print_line(format_args!("{}\nnothing flashed", failures.join("\n")));
        output::print_line(format_args!("the plans and their plots are in {out}"));
        return Ok(Exit::DoesNotHold);
    }

    let packed = plans.pack(&library)?.bytes;
    files::write(&library_path(&args.out, &library), &packed)?;

    let options = tour::Options {
        ground: ground.as_ref(),
        shoves: args.ground.shoves(),
        // In the air, torques that hold the robot's weight would push its limbs away from their targets.
        feed_forward: ground.is_some(),
        cycles: 2,
        at_places: args.ground.has_terrain(),
        world_robot: None,
        world_log: None,
    };
    let played =
        tour::play(&ValidatedLibrary::new(library.robot.clone(), packed.clone())?, options)?;
    let mut log = Vec::new();
    candump::write(played.rig.log(), &mut log).into_diagnostic()?;
    files::write(&args.out.join("bus.log"), &log)?;
    let packets = played.rig.packets();
    if !packets.is_empty() {
        let lines: String = packets.iter().map(|packet| format!("{packet}\n")).collect();
        files::write(&args.out.join("serial.log"), lines.as_bytes())?;
    }
    if interrupt::requested() {
        return Ok(Exit::Interrupted);
    }

    let outcome = DemoOutcome::new(&library, &plans, &packed, &played)?;
    if args.json {
        output::print_json(&outcome)?;
    } else {
        let text = table::render(&outcome);
        output::print(&format!("{text}\nAll files are in {}", args.out.display()))?;
    }
    Ok(if outcome.holds() { Exit::Ok } else { Exit::OutOfBounds })
}

fn library_path(out: &Path, library: &Library) -> PathBuf {
    out.join(format!("{}.rwl", file_name(&library.robot.name)))
}

fn write_plans(out: &Path, plans: &Plans) -> miette::Result<()> {
    for planned in plans.all() {
        let name = file_name(&planned.plan.motion.name);
        let plan = planned.plan.to_json();
        files::write(&out.join("plans").join(format!("{name}.json")), plan.as_bytes())?;
        let figure = plot::figure(&planned.plan, JointPanels::default());
        files::write(&out.join("plots").join(format!("{name}.svg")), figure.as_bytes())?;
    }
    let motions: Vec<_> = plans.motions.iter().map(|planned| &planned.plan).collect();
    let strip = plot::strip(&motions, STRIP_MOMENTS);
    files::write(&out.join("plots").join("robot.svg"), strip.as_bytes())
}
