//! `rollwalk robot export`: a robot file for other tools.

use crate::Exit;
use crate::files::{self, Output};
use crate::inputs::Source;
use miette::IntoDiagnostic;
use std::path::PathBuf;

/// Write a robot file as URDF or as an MJCF model for MuJoCo.
///
/// Wheels that spin are bodies of their own there; meshes are the solids of the robot file.
#[derive(clap::Args)]
#[command(after_long_help = "\
Examples:
  rollwalk robot export robots/agilebot.toml -o agilebot.urdf
  rollwalk robot export robots/agilebot.toml -o agilebot.xml     a model for MuJoCo

What each format has, and what it cannot say, is in docs/exports.md.")]
pub struct Args {
    /// Robot file (TOML).
    #[arg(value_name = "ROBOT.toml")]
    robot: PathBuf,
    /// Where to write it: .urdf, or .xml for MJCF.
    #[arg(short, long, value_name = "FILE")]
    output: PathBuf,
}

/// Runs the subcommand.
pub fn run(args: &Args) -> miette::Result<Exit> {
    let ending = files::ending(&args.output, "a robot", &["urdf", "xml"])?;
    let (robot, parts) = Source::Disk.robot_and_parts(&args.robot)?;
    let text = match ending {
        Some("xml") => rollwalk_interchange::mjcf(&robot, &parts),
        _ => rollwalk_interchange::urdf(&robot, &parts),
    };
    let place = Output::of_source(&args.output)?;
    place.write(text.into_diagnostic()?.as_bytes())?;
    place.comment(&format!("wrote {}", args.output.display()))?;
    Ok(Exit::Ok)
}
