//! `rollwalk keys`: creates keys of a robot.

use crate::signing;
use rollwalk_terminal::{Exit, keys, output};
use std::path::PathBuf;

/// Make keys.
#[derive(clap::Subcommand)]
#[command(after_long_help = "\
Examples:
  rollwalk keys new robot.key
  rollwalk keys new-pair owner.pem")]
pub enum Action {
    New(New),
    NewPair(NewPair),
}

/// Make a link key, the secret that a robot shares with its hosts.
///
/// A controller with a built-in key accepts only hosts that have it: commands, heartbeats, gains and libraries of other hosts
/// are refused. Emergency stops need no key. Only the user can read the file, and it is never overwritten. Keep a copy where
/// the robot's image is built: if the file is lost, the robot needs a new image.
#[derive(clap::Args)]
#[command(after_long_help = "\
Examples:
  rollwalk keys new robot.key
  rollwalk-sim robots/agilebot.toml --bus sim --link-key robot.key
  ROLLWALK_LINK_KEY=robot.key rollwalk send --arm walk --bus sim")]
pub struct New {
    /// File to create.
    #[arg(value_name = "FILE")]
    file: PathBuf,
}

/// Make a key pair for signing motion libraries.
///
/// Writes the private key to KEY.pem, readable only by the user, and the public key to KEY.pub.pem. Neither is ever
/// overwritten. A controller with the built-in public key plays only libraries that were signed with the private key. Without
/// the private key no library can be signed for the controller: keep a copy in a safe place, and on no robot. The keys are
/// Ed25519 in PEM, as used by OpenSSL.
#[derive(clap::Args)]
#[command(after_long_help = "\
Examples:
  rollwalk keys new-pair owner.pem
  rollwalk library sign agilebot.rwl --key owner.pem -o agilebot.signed.rwl
  rollwalk-sim robots/agilebot.toml --bus sim --library-key owner.pub.pem")]
pub struct NewPair {
    /// File of the new private key.
    #[arg(value_name = "KEY.pem")]
    file: PathBuf,
}

/// Runs the subcommand.
pub fn run(action: &Action) -> miette::Result<Exit> {
    match action {
        Action::New(New { file }) => {
            keys::new_link_key(file)?;
            let file = file.display();
            output::print(&format!(
                "wrote {file}: keep a copy, because without it the robot needs a new image\nbuild the key \
                 into the robot's image (firmware/boards/README.md), or simulate it with rollwalk-sim \
                 --link-key {file}\ngive the key to each host: --link-key {file}, or ROLLWALK_LINK_KEY"
            ))?;
        }
        Action::NewPair(NewPair { file }) => {
            let pair = signing::new_pair(file)?;
            output::print(&format!(
                "wrote {}, the private key for signing libraries: keep the file secret, and make a \
                 copy\nwrote {}, the public key for controllers: key {}\n{}",
                file.display(),
                pair.public.display(),
                pair.fingerprint,
                pair.pem.trim_end()
            ))?;
        }
    }
    Ok(Exit::Ok)
}
