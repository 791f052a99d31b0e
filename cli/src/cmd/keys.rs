//! `rollwalk keys`: secrets of a robot.

use crate::{Exit, keys, output};
use std::path::PathBuf;

/// Make keys.
#[derive(clap::Subcommand)]
pub enum Action {
    New(New),
}

/// Make a link key, the secret that a robot shares with its hosts.
///
/// A controller that was built with the key obeys only hosts that have it: commands, heartbeats, gains and libraries of
/// others are refused. Emergency stops need no key. The file is readable by its user only, and never
/// overwritten. Keep a copy where the robot's image is built: without the file the robot needs a new image.
#[derive(clap::Args)]
#[command(after_long_help = "\
Examples:
  rollwalk keys new robot.key
  rollwalk-sim robots/agilebot.toml --bus sim --link-key robot.key
  ROLLWALK_LINK_KEY=robot.key rollwalk send --arm walk --bus sim")]
pub struct New {
    /// File to make.
    #[arg(value_name = "FILE")]
    file: PathBuf,
}

/// Runs the subcommand.
pub fn run(action: &Action) -> miette::Result<Exit> {
    match action {
        Action::New(New { file }) => {
            keys::new_link_key(file)?;
            let file = file.display();
            output::print(&format!("wrote {file}; --link-key {file} uses it"))?;
        }
    }
    Ok(Exit::Ok)
}
