//! `rollwalk library`: motion libraries, the files that a controller plays.

mod build;
mod inspect;

use crate::Exit;

/// Build and inspect motion libraries.
#[derive(clap::Subcommand)]
pub enum Action {
    Build(build::Args),
    Inspect(inspect::Args),
}

/// Runs the subcommand.
pub fn run(action: &Action) -> miette::Result<Exit> {
    match action {
        Action::Build(args) => build::run(args),
        Action::Inspect(args) => inspect::run(args),
    }
}
