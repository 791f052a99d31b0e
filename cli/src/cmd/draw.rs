//! `rollwalk robot draw`: draws a robot file as a picture.

use crate::picture;
use miette::miette;
use rollwalk_planner::plot;
use rollwalk_terminal::Exit;
use rollwalk_terminal::files::{self, Output};
use rollwalk_terminal::inputs::Source;
use std::path::PathBuf;

/// Draw a robot in its nominal pose, with the names of its joints and end effectors.
#[derive(clap::Args)]
#[command(after_long_help = "\
Examples:
  rollwalk robot draw robots/agilebot.toml -o agilebot.svg
  rollwalk robot draw my-robot.toml -o my-robot.png     needs rsvg-convert")]
pub struct Args {
    /// Robot file (TOML).
    #[arg(value_name = "ROBOT.toml")]
    robot: PathBuf,
    /// Output picture: .svg or .png.
    #[arg(short, long, value_name = "FILE")]
    output: PathBuf,
}

/// Runs the subcommand.
pub fn run(args: &Args) -> miette::Result<Exit> {
    let ending = files::ending(&args.output, "a picture", &["svg", "png"])?;
    let robot = Source::Disk.robot(&args.robot)?;
    let svg = plot::robot(&robot).ok_or_else(|| {
        miette!(
            help = "show the robot in another pose with `rollwalk studio`",
            "{} cannot be drawn in its nominal pose, because a wheel lies flat",
            args.robot.display()
        )
    })?;
    let place = Output::at(&args.output)?;
    match ending {
        Some("png") => place.write(&picture::png(&svg)?)?,
        _ => place.write(svg.as_bytes())?,
    }
    place.comment(&format!("wrote {}", args.output.display()))?;
    Ok(Exit::Ok)
}
