//! `rollwalk library`: motion libraries, the files that a controller plays.

mod build;
mod inspect;

use crate::Exit;

/// Build motion libraries and look into them.
#[derive(clap::Args)]
pub struct Args {
    #[command(subcommand)]
    command: Subcommand,
}

#[derive(clap::Subcommand)]
enum Subcommand {
    Build(build::Args),
    Inspect(inspect::Args),
}

/// Runs the subcommand.
pub fn run(args: &Args) -> miette::Result<Exit> {
    match &args.command {
        Subcommand::Build(args) => build::run(args),
        Subcommand::Inspect(args) => inspect::run(args),
    }
}
