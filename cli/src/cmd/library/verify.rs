//! `rollwalk library verify`: checks the owner's signature of a motion library.

use crate::signing::{self, Fingerprint};
use miette::miette;
use rollwalk_protocol::library::identity;
use rollwalk_terminal::kind::Kind;
use rollwalk_terminal::{Exit, files, output};
use std::path::PathBuf;

/// Check the signature of a motion library as a controller with the given public key does.
///
/// The exit code is 1 if the library is not signed, was signed with another key, or was changed afterwards. `rollwalk library
/// inspect` prints the content of a library.
#[derive(clap::Args)]
#[command(after_long_help = "\
Examples:
  rollwalk library verify agilebot.signed.rwl --key owner.pub.pem")]
pub struct Args {
    /// Motion library.
    #[arg(value_name = "LIB.rwl")]
    library: PathBuf,
    /// Public key.
    #[arg(long, value_name = "KEY.pub.pem")]
    key: PathBuf,
}

/// Runs the subcommand.
pub fn run(args: &Args) -> miette::Result<Exit> {
    let key = signing::public_key(&args.key)?;
    let file = files::read(&args.library, Kind::Packed)?;
    // Sources of a library and keys are text; a signature would not make a library of them.
    if let Ok(text) = std::str::from_utf8(&file) {
        Kind::Packed.expect(&args.library, text)?;
    }
    let path = args.library.display();
    let Some(identity) = identity(&file) else {
        let help = Kind::Packed.hint();
        return Err(miette!(help = help, "{path} is not a motion library"));
    };
    if let Err(why) = signing::check(&file, &key) {
        return Err(miette!(help = why.help(), "{path} {why}"));
    }
    output::print(&format!(
        "{path}: motion library {identity:#010x}, signed with key {}",
        Fingerprint::of(&key)
    ))?;
    Ok(Exit::Ok)
}
