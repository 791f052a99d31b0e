//! `rollwalk bench`: runs `rollwalk-bench`.

use crate::apps::{BENCH, Words};
use rollwalk_terminal::Exit;

/// Re-run the thesis's tables and figures, measure the library format, and run the fault campaign.
///
/// The program rollwalk-bench, which lies beside rollwalk, does it; `rollwalk bench --help` prints its help.
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
    words: Words,
}

/// Becomes the program.
pub fn run(args: &Args) -> miette::Result<Exit> {
    BENCH.run(args.words.words.iter().cloned())
}
