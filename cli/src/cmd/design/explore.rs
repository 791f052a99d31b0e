//! `rollwalk design explore`: runs `rollwalk-bench explore`.

use crate::apps::{BENCH, ProgramArgs};
use rollwalk_terminal::Exit;
use std::iter;

/// Plan every point of a sweep: parameters, goals, gaits, robots, servos. Write motion data for learning.
///
/// This command runs the program rollwalk-bench, which must be in the same folder as rollwalk or on the path. `rollwalk design
/// explore --help` prints its help.
#[derive(clap::Args)]
#[command(
    disable_help_flag = true,
    after_long_help = "\
Examples:
  rollwalk design explore --help
  rollwalk design explore designs/table_3_2_sweep.toml -o table"
)]
pub struct Args {
    #[command(flatten)]
    words: ProgramArgs,
}

/// Replaces this process by the program.
pub fn run(args: &Args) -> miette::Result<Exit> {
    BENCH.run(iter::once("explore".into()).chain(args.words.words.iter().cloned()))
}
