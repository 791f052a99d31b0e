//! `rollwalk plot`: draws plans and logs of the simulated world as figures.

mod world;

use crate::picture;
use rollwalk_planner::plan::Plan;
use rollwalk_planner::plot::{self, AnimationParts, JointPanels};
use rollwalk_terminal::files::{self, Output};
use rollwalk_terminal::{Exit, inputs};
use std::path::{Path, PathBuf};

/// Number of pictures of a motion in a strip.
pub const STRIP_MOMENTS: usize = 6;

/// Draw a plan: footfalls, centre of mass, swing heights, support, angles, speeds and torques of joints, wheel speeds, ground
/// forces; or a log of the simulated world: distance, height, tilt, speed, ground forces, slip, torques.
#[derive(clap::Args)]
#[command(after_long_help = "\
Examples:
  rollwalk plot walk.plan.json -o walk.svg
  rollwalk plot --each-joint walk.plan.json -o joints.svg
  rollwalk plot --strip drive.plan.json walk.plan.json -o robot.svg
  rollwalk plot --animate walk.plan.json -o moving.svg   # plays in browsers and in READMEs
  rollwalk plot --animate --forces --footfalls walk.plan.json -o moving.svg
  rollwalk plot --animate walk.plan.json -o moving.gif   # or .mp4; needs rsvg-convert and ffmpeg
  rollwalk plot run.csv -o run.svg       # of `rollwalk simulate walk.plan.json --world-log run.csv`")]
pub struct Args {
    /// Plan (JSON), or log of the simulated world (CSV); several plans with --strip.
    #[arg(value_name = "PLAN.json|RUN.csv", required = true)]
    plans: Vec<PathBuf>,
    /// Draw separate panels for every joint, which show small motions beside large ones; by default the joints of a limb share
    /// panels.
    #[arg(long, conflicts_with_all = ["strip", "animate"])]
    each_joint: bool,
    /// Draw the robot itself instead, at six times of each plan.
    #[arg(long)]
    strip: bool,
    /// Draw the robot in motion, in real time: one SVG file that any browser plays, even as an image of a README.
    #[arg(long, conflicts_with = "strip")]
    animate: bool,
    /// Draw the ground forces as arrows; only with --animate.
    #[arg(long, requires = "animate")]
    forces: bool,
    /// Draw the footfall chart with a line at the current time; only with --animate.
    #[arg(long, requires = "animate")]
    footfalls: bool,
    /// Output figure: .svg or .png; with --animate .svg, .gif or .mp4.
    #[arg(short, long, value_name = "FILE")]
    output: PathBuf,
}

/// Runs the subcommand.
pub fn run(args: &Args) -> miette::Result<Exit> {
    let ending = match args.animate {
        true => files::ending(&args.output, "an animation", &["svg", "gif", "mp4"])?,
        false => files::ending(&args.output, "a figure", &["svg", "png"])?,
    };
    let is_log = |path: &&PathBuf| {
        path.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("csv"))
    };
    if let Some(log) = args.plans.iter().find(is_log) {
        if args.strip || args.animate || args.each_joint || args.plans.len() > 1 {
            return Err(miette::miette!(
                help = "draw the world log alone, without --strip, --animate or --each-joint",
                "{} is a world log, which requires a figure of its own",
                log.display()
            ));
        }
        return finish(&args.output, ending, &world::figure(log)?);
    }
    let plans: Vec<Plan> =
        args.plans.iter().map(|path| inputs::plan(path)).collect::<miette::Result<_>>()?;
    let svg = match &plans[..] {
        plans if args.strip => plot::strip(&plans.iter().collect::<Vec<_>>(), STRIP_MOMENTS),
        [plan] if args.animate => {
            let extras = AnimationParts { forces: args.forces, footfalls: args.footfalls };
            if let Some(film) = ending.filter(|ending| *ending != "svg") {
                let place = Output::at(&args.output)?;
                let (frame_s, pictures) = plot::frames(plan, extras);
                return write_and_report(&place, &picture::film(frame_s, &pictures, film)?);
            }
            plot::animation(plan, extras)
        }
        [plan] => {
            plot::figure(plan, if args.each_joint { JointPanels::Joint } else { JointPanels::Limb })
        }
        _ => {
            return Err(miette::miette!(
                help = match args.animate {
                    true => "give one plan to animate",
                    false => "give one plan, or add --strip",
                },
                "{} plans do not fit into one figure",
                plans.len()
            ));
        }
    };
    finish(&args.output, ending, &svg)
}

fn finish(path: &Path, ending: Option<&str>, svg: &str) -> miette::Result<Exit> {
    let place = Output::at(path)?;
    match ending {
        Some("png") => write_and_report(&place, &picture::png(svg)?),
        _ => write_and_report(&place, svg.as_bytes()),
    }
}

fn write_and_report(place: &Output, content: &[u8]) -> miette::Result<Exit> {
    place.write(content)?;
    place.comment(&format!("wrote {}", place.path().display()))?;
    Ok(Exit::Ok)
}
