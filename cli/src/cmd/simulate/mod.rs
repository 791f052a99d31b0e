//! `rollwalk simulate`: a plan by itself, or a library behind the firmware, on the simulated ground.

mod library;
mod plan;

use crate::terrain::GroundArgs;
use crate::world_log::WorldLogArgs;
use rollwalk_terminal::{Exit, inputs};
use std::path::PathBuf;

/// Play a plan or a motion library on the simulated ground.
///
/// A plan (JSON) plays open loop, without bus and controller: the servos of the robot file play it, with the planned torques on
/// top, on rigid ground with the friction of the robot file. What becomes of it is compared with the plan: a motion holds in
/// simulation if the robot stays on its feet and comes to 0.95 to 1.05 of every goal, on the mean of its periods after the
/// first one and on that of the last three; the exit code is 3 if it does not.
///
/// A motion library (LIB.rwl) plays as on the robot: it is flashed to the firmware over the simulated bus, and every
/// transition of its motion graph is played. The table tells the way of each motion, and what that is of its plan where the
/// library was built on this computer; the exit code is 3 if the robot falls or is stopped, or if a motion does not come where
/// its plan does. On Ctrl-C the robot returns to SAFE and is disarmed, and the table lists the motions played so far.
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
  rollwalk simulate pup.rwl --robot pup.toml --slope 2")]
pub struct Args {
    /// Plan (JSON) or motion library.
    #[arg(value_name = "PLAN.json|LIB.rwl")]
    what: PathBuf,
    /// Robot file (TOML) of the robot that a library is for; without it the robots that ship with rollwalk are tried.
    #[arg(long, value_name = "ROBOT.toml")]
    robot: Option<PathBuf>,
    /// Periods of a motion that repeats.
    #[arg(long, value_name = "COUNT", default_value_t = 5, value_parser = clap::value_parser!(u32).range(1..=10_000))]
    cycles: u32,
    /// Leave the planned torques out: the servos' own only.
    #[arg(long)]
    no_feed_forward: bool,
    /// Let a controller of the whole body track a plan: it sees the robot at each step, and tells its motors torques.
    #[arg(long, conflicts_with = "no_feed_forward")]
    tracking: bool,
    /// Masses of the simulated robot over those of the plan's.
    #[arg(long, value_name = "RATIO", default_value_t = 1.0, value_parser = ratio)]
    mass: f64,
    /// Coefficient of friction of all feet, wheels and blades of the simulated robot [default: those of the plan's].
    #[arg(long, value_name = "COEFFICIENT", value_parser = ratio)]
    friction: Option<f64>,
    /// Stiffness of contacts with the ground over the usual one.
    #[arg(long, value_name = "RATIO", default_value_t = 1.0, value_parser = ratio)]
    contact_stiffness: f64,
    /// Time from a measurement to the setpoints that answer it, ms, with --tracking.
    #[arg(long, value_name = "MS", default_value_t = 0.0, requires = "tracking", value_parser = delay_ms)]
    delay_ms: f64,
    /// Estimate the state from an IMU, encoders and contacts with noise, instead of giving the controller the true state; with
    /// --tracking and on level ground only.
    #[arg(long, requires = "tracking", conflicts_with_all = ["slope", "terrain"])]
    estimate: bool,
    #[command(flatten)]
    ground: GroundArgs,
    /// Steps of the simulation of a plan per second [default: 480, with --tracking 500]; with a library they are 240.
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
