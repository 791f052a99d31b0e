//! `rollwalk library`: builds, inspects, signs and verifies motion libraries, the files that a controller plays.

mod build;
mod inspect;
mod sign;
mod verify;

use rollwalk_terminal::Exit;

/// Build, inspect and sign motion libraries.
#[derive(clap::Subcommand)]
#[command(after_long_help = "\
Examples:
  rollwalk library build motions/pup_library.toml -o pup.rwl
  rollwalk library inspect pup.rwl")]
pub enum Action {
    Build(build::Args),
    Inspect(inspect::Args),
    Sign(sign::Args),
    Verify(verify::Args),
}

/// Runs the subcommand.
pub fn run(action: &Action) -> miette::Result<Exit> {
    match action {
        Action::Build(args) => build::run(args),
        Action::Inspect(args) => inspect::run(args),
        Action::Sign(args) => sign::run(args),
        Action::Verify(args) => verify::run(args),
    }
}
