//! `rollwalk library sign`: appends the owner's signature to a motion library.

use crate::signing::{self, Fingerprint};
use rollwalk_terminal::Exit;
use rollwalk_terminal::files::Output;
use rollwalk_terminal::validated_library::ValidatedLibrary;
use std::path::PathBuf;

/// Sign a motion library, for controllers that play only signed ones.
///
/// The library is first validated as a controller does. An existing signature is replaced. `rollwalk keys new-pair` creates the
/// key.
#[derive(clap::Args)]
#[command(after_long_help = "\
Examples:
  rollwalk library sign agilebot.rwl --key owner.pem -o agilebot.signed.rwl
  rollwalk library verify agilebot.signed.rwl --key owner.pub.pem
  rollwalk flash agilebot.signed.rwl --bus sim

docs/formats/motion-library.md describes what is added to the file.")]
pub struct Args {
    /// Motion library.
    #[arg(value_name = "LIB.rwl")]
    library: PathBuf,
    /// Private key.
    #[arg(long, value_name = "KEY.pem")]
    key: PathBuf,
    /// Output file: the signed library.
    #[arg(short, long, value_name = "SIGNED.rwl")]
    output: PathBuf,
    /// Robot file (TOML) of the library's robot, if it does not ship with rollwalk.
    #[arg(long, value_name = "ROBOT.toml")]
    robot: Option<PathBuf>,
}

/// Runs the subcommand.
pub fn run(args: &Args) -> miette::Result<Exit> {
    let packed = ValidatedLibrary::read(&args.library, args.robot.as_deref())?;
    let key = signing::private_key(&args.key)?;
    let place = Output::at(&args.output)?;
    let signed = signing::signed(packed.library().bytes(), &key);
    place.write(&signed)?;
    place.comment(&format!(
        "wrote {}: {} for {}, signed with key {}",
        args.output.display(),
        args.library.display(),
        packed.robot.name,
        Fingerprint::of(&key.verifying_key())
    ))?;
    Ok(Exit::Ok)
}
