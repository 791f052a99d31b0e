//! `rollwalk flash`: transfers a motion library to the controller, which verifies and activates it.

use crate::signing::{self, Fingerprint};
use crate::tour::transfer_bar;
use miette::miette;
use rollwalk_bus::link::LinkBus;
use rollwalk_host::session::{Session, SessionError};
use rollwalk_protocol::library::{Library, RejectReason};
use rollwalk_protocol::wire::transport::{TransferResult, UNSIGNED};
use rollwalk_terminal::link::{LinkArgs, names, report_failure, report_refusal};
use rollwalk_terminal::validated_library::{ValidatedLibrary, robot_of};
use rollwalk_terminal::{Exit, interrupt, output};
use serde::Serialize;
use std::path::PathBuf;
use std::time::Instant;

/// Transfer a motion library to the controller, which checks and activates it.
///
/// The library is first validated on this computer, by the controller's rules. The controller must be disarmed. It checks every
/// block and then the whole library; until then its previous library stays active. An interrupted transfer resumes where it
/// stopped.
///
/// A controller with a built-in key accepts only libraries that `rollwalk library sign` has signed with it. A controller
/// without a key also accepts signed libraries, which are sent to it without the signature.
#[derive(clap::Args)]
#[command(after_long_help = "\
Examples:
  rollwalk flash agilebot.rwl --bus can:can0
  rollwalk flash agilebot.signed.rwl --bus can:can0
  rollwalk flash pup.rwl --robot pup.toml --bus serial:/dev/ttyUSB0")]
pub struct Args {
    /// Motion library.
    #[arg(value_name = "LIB.rwl")]
    library: PathBuf,
    #[command(flatten)]
    link: LinkArgs,
    /// Robot file (TOML) of the library's robot, if it does not ship with rollwalk.
    #[arg(long, value_name = "ROBOT.toml")]
    robot: Option<PathBuf>,
    /// Print the outcome as JSON.
    #[arg(long)]
    json: bool,
}

/// Output of `--json`.
#[derive(Serialize)]
struct FlashOutput {
    robot: String,
    /// CRC-32C of the body, by which a controller identifies the library.
    library: String,
    bytes: usize,
    time_s: f64,
}

/// Runs the subcommand.
pub fn run(args: &Args) -> miette::Result<Exit> {
    let packed = ValidatedLibrary::read(&args.library, args.robot.as_deref())?;
    let mut session = args.link.connect()?;
    let (ours, theirs) = (packed.library().index().config_hash(), session.hello().config_hash);
    if ours != theirs {
        let report = miette!(
            help = format!(
                "flash a library of the controller's robot, or select another controller with \
                 --node: rollwalk discover --bus {} lists them; if the firmware is old, build it for \
                 this robot",
                args.link.bus
            ),
            "{} is for {} (configuration {ours:08x}), but the controller is for {} (configuration \
             {theirs:08x})",
            args.library.display(),
            packed.robot.name,
            robot_of(theirs).map_or_else(|| "another robot".to_owned(), |robot| robot.name),
        );
        return Err(report_refusal(&report).into());
    }
    let start = Instant::now();
    let signer = signing::signer(&packed.file);
    let mut outcome = flash(&mut session, &packed.file);
    let trailing = RejectReason::TrailingBytes { len: 0, expected: 0 }.code();
    if signer.is_some() && outcome.as_ref().err().and_then(refused_for) == Some(trailing) {
        output::print_line(
            "The controller does not check signatures; the library is sent again without its \
             signature.",
        );
        outcome = flash(&mut session, packed.library().bytes());
    }
    if let Err(error) = outcome {
        return Ok(broken_off(args, signer, &error));
    }
    names::cache(&packed.catalog());
    report(args, &packed.robot.name, &packed.library(), packed.file.len(), start)
}

/// Transfers a file with a progress bar.
fn flash<B: LinkBus>(session: &mut Session<B>, file: &[u8]) -> Result<(), SessionError> {
    let bar = transfer_bar(file.len());
    let outcome = session.flash(file, |progress| bar.set_position(progress.done as u64));
    if outcome.is_ok() {
        bar.finish_and_clear();
    } else {
        bar.abandon();
    }
    outcome
}

/// Rejection code of the controller; `None` for other errors.
fn refused_for(error: &SessionError) -> Option<u8> {
    match error {
        SessionError::LibraryRefused { reply } if reply.result == TransferResult::Rejected => {
            Some(reply.why)
        }
        _ => None,
    }
}

fn broken_off(args: &Args, signer: Option<Fingerprint>, error: &SessionError) -> Exit {
    let exit = report_failure(&args.link, error);
    if refused_for(error) == Some(UNSIGNED) {
        let path = args.library.display();
        output::print_line(match signer {
            Some(key) => format!(
                "{path} is signed with key {key}, or was changed after signing: check the file with \
                 `rollwalk library verify`."
            ),
            None => format!("{path} is not signed."),
        });
    }
    if interrupt::requested()
        || matches!(error, SessionError::Link(_) | SessionError::Silent { .. })
    {
        output::print_line("Run the same command again to resume the transfer.");
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
    let outcome = FlashOutput {
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
