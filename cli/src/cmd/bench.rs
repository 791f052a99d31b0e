//! `rollwalk bench`: runs `rollwalk-bench`.

use crate::apps::{BENCH, ProgramArgs};
use rollwalk_terminal::Exit;

/// Reproduce the tables and figures of the thesis, measure the library format, and run the fault campaign.
///
/// This command runs the program rollwalk-bench, which must be in the same folder as rollwalk or on the path. `rollwalk bench
/// --help` prints its help.
#[derive(clap::Args)]
#[command(
    disable_help_flag = true,
    after_long_help = "\
Examples:
  rollwalk bench --help
  rollwalk bench table-2-1 --out bench"
)]
pub struct Args {
    #[command(flatten)]
    words: ProgramArgs,
}

/// Replaces this process by the program.
pub fn run(args: &Args) -> miette::Result<Exit> {
    BENCH.run(args.words.words.iter().cloned())
}
