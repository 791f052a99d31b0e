//! `rollwalk library`: motion libraries, the files that a controller plays.

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
    Inspect(inspect::Args),
}

/// Runs the subcommand.
pub fn run(args: &Args) -> miette::Result<Exit> {
    match &args.command {
        Subcommand::Inspect(args) => inspect::run(args),
    }
}
