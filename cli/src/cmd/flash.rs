//! `rollwalk flash`: a motion library to the controller, verified and taken into use.

use crate::cmd::demo::transfer_bar;
use crate::link::{LinkArgs, ended, names};
use crate::packed::Packed;
use crate::{Exit, interrupt, output};
use miette::miette;
use rollwalk_host::session::SessionError;
use rollwalk_protocol::library::Library;
use serde::Serialize;
use std::path::PathBuf;
use std::time::Instant;

/// Transfer a motion library to the controller, which checks and activates it.
///
/// The library is first validated on this computer, by the controller's rules. The controller must be disarmed. It
/// checks every block and then the whole library; until then its previous library stays active. A transfer that was
/// interrupted resumes where it stopped.
#[derive(clap::Args)]
#[command(after_long_help = "\
Examples:
  rollwalk flash agilebot.rwl --bus can:can0
  rollwalk flash pup.rwl --robot pup.toml --bus serial:/dev/ttyUSB0")]
pub struct Args {
    /// Motion library.
    #[arg(value_name = "LIB.rwl")]
    library: PathBuf,
    #[command(flatten)]
    link: LinkArgs,
    /// Robot file (TOML) of the robot that the library is for, if it does not ship with rollwalk.
    #[arg(long, value_name = "ROBOT.toml")]
    robot: Option<PathBuf>,
    /// Print the outcome as JSON.
    #[arg(long)]
    json: bool,
}

/// Output of `--json`.
#[derive(Serialize)]
struct Outcome {
    robot: String,
    /// CRC-32C of the body, with which a controller identifies the library.
    library: String,
    bytes: usize,
    time_s: f64,
}

/// Runs the subcommand.
pub fn run(args: &Args) -> miette::Result<Exit> {
    let packed = Packed::read(&args.library, args.robot.as_deref())?;
    let mut session = args.link.connect()?;
    let (ours, theirs) = (packed.library().index().config_hash(), session.hello().config_hash);
    if ours != theirs {
        return Err(miette!(
            help = "the firmware is made for one robot: build it for this one, or build the library from \
                    the robot file that the firmware was built for",
            "{} is for {} (configuration {ours:08x}), the controller is for configuration {theirs:08x}",
            args.library.display(),
            packed.robot.name,
        ));
    }
    let start = Instant::now();
    let bar = transfer_bar(packed.bytes.len());
    let outcome = session.flash(&packed.bytes, |progress| bar.set_position(progress.done as u64));
    if outcome.is_ok() {
        bar.finish_and_clear();
    } else {
        bar.abandon();
    }
    if let Err(error) = outcome {
        return Ok(broken_off(args, &error));
    }
    names::keep(&packed.catalog());
    report(args, &packed.robot.name, &packed.library(), packed.bytes.len(), start)
}

fn broken_off(args: &Args, error: &SessionError) -> Exit {
    let exit = ended(&args.link, error);
    if interrupt::requested()
        || matches!(error, SessionError::Link(_) | SessionError::Silent { .. })
    {
        output::say("The same command again goes on where this stopped.");
    }
    exit
}

fn report(
    args: &Args,
    robot: &str,
    library: &Library<'_>,
    bytes: usize,
    start: Instant,
) -> miette::Result<Exit> {
    let outcome = Outcome {
        robot: robot.to_owned(),
        library: format!("{:08x}", library.index().id()),
        bytes,
        time_s: start.elapsed().as_secs_f64(),
    };
    if args.json {
        output::print_json(&outcome)?;
    } else {
        output::print(&format!(
            "{} has library {}: {} motions, {} B in {:.1} s, verified and in use",
            outcome.robot,
            outcome.library,
            library.node_count(),
            outcome.bytes,
            outcome.time_s
        ))?;
    }
    Ok(Exit::Ok)
}
