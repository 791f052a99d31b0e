//! `rollwalk simulate`: simulates a plan alone, or a library behind the firmware, on the ground.

mod library;
mod plan;

use crate::terrain::GroundArgs;
use crate::world_log::WorldLogArgs;
use rollwalk_terminal::{Exit, inputs};
use std::path::PathBuf;

/// Play a plan or a motion library on the simulated ground.
///
/// A plan (JSON) plays in open loop, without bus and controller: the servos of the robot file play it, with the planned torques
/// as feed-forward, on rigid ground with the friction of the robot file. The result is compared with the plan. The motion
/// passes if the robot does not fall and reaches 95 % to 105 % of every goal, both in the mean of its periods after the first
/// and in the mean of the last three; otherwise the exit code is 3.
///
/// A motion library (LIB.rwl) plays as on the robot: it is transferred to the firmware over the simulated bus, and every
/// transition of its motion graph is played. The tables list the displacement of each motion, its ratio to the plan if the
/// library was built on this computer, and the net displacement from SAFE to SAFE. The exit code is 3 if the robot falls or is
/// stopped, or if a motion misses a goal of its plan. On Ctrl-C the robot returns to SAFE and is disarmed, and the tables list
/// the motions played so far.
#[derive(clap::Args)]
#[command(after_long_help = "\
Examples:
  rollwalk simulate walk.plan.json
  rollwalk simulate walk.plan.json --cycles 20 --no-feed-forward
  rollwalk simulate turn.plan.json --tracking
  rollwalk simulate turn.plan.json --tracking --estimate --mass 1.1 --friction 0.5 --delay-ms 6
  rollwalk simulate walk.plan.json --terrain doorstep.toml --push 2:20,0,0:0.1
  rollwalk simulate walk.plan.json --slope 5 --json
  rollwalk simulate demo-out/agilebot.rwl --cycles 3 --world-log run.csv
  rollwalk simulate pup.rwl --robot pup.toml --slope 2
  rollwalk simulate pup.rwl --mass 1.2 --friction 0.5")]
pub struct Args {
    /// Plan (JSON) or motion library.
    #[arg(value_name = "PLAN.json|LIB.rwl")]
    what: PathBuf,
    /// Robot file (TOML) of a library's robot; without it the robots that ship with rollwalk are tried.
    #[arg(long, value_name = "ROBOT.toml")]
    robot: Option<PathBuf>,
    /// Number of periods of a periodic motion.
    #[arg(long, value_name = "COUNT", default_value_t = 5, value_parser = clap::value_parser!(u32).range(1..=10_000))]
    cycles: u32,
    /// Simulate servos without feed-forward of the planned torques.
    #[arg(long)]
    no_feed_forward: bool,
    /// Track a plan with a whole-body controller, which reads the robot's state at each step and commands torques to its
    /// motors.
    #[arg(long, conflicts_with = "no_feed_forward")]
    tracking: bool,
    /// Ratio of the masses of the simulated robot to those of the planned robot.
    #[arg(long, value_name = "RATIO", default_value_t = 1.0, value_parser = ratio)]
    mass: f64,
    /// Coefficient of friction of all feet, wheels and blades of the simulated robot [default: those of the planned robot].
    #[arg(long, value_name = "COEFFICIENT", value_parser = ratio)]
    friction: Option<f64>,
    /// Ratio of the stiffness of ground contacts to the default stiffness; for a plan only.
    #[arg(long, value_name = "RATIO", default_value_t = 1.0, value_parser = ratio)]
    contact_stiffness: f64,
    /// Delay from a measurement to the set-points that answer it, ms, with --tracking.
    #[arg(long, value_name = "MS", default_value_t = 0.0, requires = "tracking", value_parser = delay_ms)]
    delay_ms: f64,
    /// Estimate the state from a noisy IMU, encoders and contacts, instead of giving the controller the true state. Only with
    /// --tracking, and without --slope and --terrain: the estimator assumes level ground.
    #[arg(long, requires = "tracking", conflicts_with_all = ["slope", "terrain"])]
    estimate: bool,
    #[command(flatten)]
    ground: GroundArgs,
    /// Simulation steps per second for a plan [default: 480, with --tracking 500]; a library uses 240.
    #[arg(long, value_name = "HZ", value_parser = clap::value_parser!(u32).range(30..=10_000))]
    rate: Option<u32>,
    #[command(flatten)]
    world_log: WorldLogArgs,
    /// Print as JSON.
    #[arg(long)]
    json: bool,
}

fn ratio(text: &str) -> Result<f64, String> {
    inputs::number_within(text, 0.01..=10.0)
}

fn delay_ms(text: &str) -> Result<f64, String> {
    inputs::number_within(text, 0.0..=100.0)
}

/// Runs the subcommand.
pub fn run(args: &Args) -> miette::Result<Exit> {
    if args.what.extension().is_some_and(|extension| extension == "rwl") {
        library::run(args)
    } else {
        plan::run(args)
    }
}
