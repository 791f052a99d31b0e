//! `rollwalk-bench`: runs benchmarks for `rollwalk bench`, and sweeps over designs for `rollwalk design explore`.

mod benchmarks;
mod explore;

use clap::error::ErrorKind;
use clap::{CommandFactory, Parser};
use rollwalk_terminal::generated::{self, Shell};
use rollwalk_terminal::{Exit, arguments, end, with_common_help};
use std::path::PathBuf;
use std::process::ExitCode;

/// Command-line word that selects [`explore`]. Benchmarks have other names.
const EXPLORE: &str = "explore";

/// Re-run the thesis's tables and figures, measure the library format, and run the fault campaign.
///
/// Solves run on one thread, and their time is the CPU time of that thread. The fault campaign is not timed, and runs on all
/// cores. Results are written to stdout and, as Markdown, JSON and SVG, to the output folder. docs/benchmarks.md describes
/// them. The fault campaign, table-3-2, table-3-3, tracking, sensor-faults and suggestions can be split into shards
/// (docs/design.md).
#[derive(Parser)]
#[command(
    name = "rollwalk-bench",
    bin_name = "rollwalk bench",
    version,
    max_term_width = 100,
    arg_required_else_help = true,
    // clap shows a benchmark as optional, because `--man` and `--completions` need none.
    override_usage = "rollwalk bench [OPTIONS] <COMMAND>",
    after_long_help = benchmarks::EXAMPLES
)]
struct Bench {
    #[command(flatten)]
    args: benchmarks::Args,
    /// Write the manual pages into this folder and exit.
    #[arg(long, value_name = "FOLDER", exclusive = true)]
    man: Option<PathBuf>,
    /// Print a completion script for this shell and exit.
    #[arg(long, value_name = "SHELL", exclusive = true)]
    completions: Option<Shell>,
}

#[derive(Parser)]
#[command(
    name = "rollwalk-design-explore",
    bin_name = "rollwalk design explore",
    version,
    max_term_width = 100
)]
struct Explore {
    #[command(flatten)]
    args: explore::Args,
}

/// Command lines of the program: one for benchmarks, one for sweeps.
pub fn command_lines() -> [clap::Command; 2] {
    let bench = with_common_help(Bench::command(), &|_| &[Exit::DoesNotHold, Exit::OutOfBounds]);
    [bench, with_common_help(Explore::command(), &|_| &[])]
}

/// Parses the command line and runs it.
pub fn main() -> ExitCode {
    let [bench, explore] = command_lines();
    let mut words: Vec<_> = std::env::args_os().collect();
    end(if words.get(1).is_some_and(|word| word == EXPLORE) {
        words.remove(1);
        let explore: miette::Result<Explore> = arguments::parse(explore, &words, |error| error);
        explore.and_then(|explore| explore::run(&explore.args))
    } else {
        let bench = arguments::parse(bench, &words, |error| error);
        bench.and_then(|bench| run(&bench))
    })
}

fn run(bench: &Bench) -> miette::Result<Exit> {
    let [mut command, explore] = command_lines();
    if let Some(folder) = &bench.man {
        generated::manual(command, folder)?;
        generated::manual(explore, folder)?;
        return Ok(Exit::Ok);
    }
    if let Some(shell) = bench.completions {
        generated::completions(&mut command, shell)?;
        return Ok(Exit::Ok);
    }
    match &bench.args.which {
        Some(which) => benchmarks::run(which, &bench.args),
        None => command.error(ErrorKind::MissingSubcommand, "name a benchmark").exit(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rollwalk_terminal::examples;

    #[test]
    fn the_command_lines_are_consistent() {
        command_lines().into_iter().for_each(clap::Command::debug_assert);
    }

    #[test]
    fn every_example_is_understood_and_every_benchmark_has_one() {
        let [bench, explore] = command_lines();
        let shown = examples::of(&bench);
        for below in bench.get_subcommands().map(clap::Command::get_name) {
            assert!(
                shown.iter().any(|words| words.get(2).is_some_and(|of| of == below)),
                "{below}"
            );
        }
        let parse = |words: &[String]| match words {
            [_, group, rest @ ..] if group == "bench" => {
                bench.clone().try_get_matches_from([&["rollwalk-bench".to_owned()], rest].concat())
            }
            [_, _, rest @ ..] => explore.clone().try_get_matches_from(rest),
            _ => panic!("{words:?}"),
        };
        let found = examples::of(&bench).into_iter().chain(examples::of(&explore));
        let count = found
            .inspect(|words| {
                drop(parse(words).unwrap_or_else(|e| panic!("{}: {e}", words.join(" "))))
            })
            .count();
        assert!(count > 20, "{count} examples");
    }
}
