//! The `rollwalk` command line: joins planner, library, bus and simulated robot, and owns what those
//! must not touch: files, the terminal, the clock and Ctrl-C.
//!
//! One file per subcommand in `cli/src/cmd`, each with its arguments and a `run`. Results go to stdout,
//! progress to stderr; how a run ends is an [`Exit`]. [`sim`] is the other binary, `rollwalk-sim`. The program of `ros2/` reaches robots with
//! the same options and in the same way, by [`link`].

mod choices;
mod cmd;
#[cfg(test)]
mod examples;
pub mod exit;
mod files;
mod gamepad;
pub mod generated;
mod inputs;
pub mod interrupt;
mod keys;
mod kind;
pub mod link;
mod live;
pub mod output;
mod packed;
mod picture;
mod planning;
mod played;
mod problem;
mod progress;
mod shards;
mod shipped;
mod signing;
pub mod sim;
mod studio;
mod system;
mod terrain;
mod tour;
mod words;
mod world_log;

pub use exit::Exit;

use clap::{CommandFactory, FromArgMatches, Parser};
use std::process::ExitCode;

/// Make robots with legs and wheels move.
#[derive(Parser)]
#[command(name = "rollwalk", version, max_term_width = 100)]
#[command(after_long_help = "\
Where to begin:
  rollwalk demo --out demo-out          everything, end to end, without hardware
  rollwalk robot check my-robot.toml    is my robot file right?
  rollwalk plan my-motion.toml -o my-motion.plan.json")]
struct Cli {
    #[command(subcommand)]
    command: cmd::Command,
}

/// The command line; the long help of every subcommand ends with the exit codes.
pub fn command_line() -> clap::Command {
    fn with_exit_codes(command: clap::Command) -> clap::Command {
        let examples = command.get_after_long_help().map(|text| format!("{text}\n\n"));
        let help = examples.unwrap_or_default() + exit::HELP;
        command.after_long_help(help).mut_subcommands(with_exit_codes)
    }
    with_exit_codes(with_negative_numbers(Cli::command()))
}

/// Lets all arguments take negative numbers. Those that are not allowed are then refused with the range that is, not as options
/// that do not exist.
fn with_negative_numbers(command: clap::Command) -> clap::Command {
    let arg = |arg: clap::Arg| {
        let takes_values = arg.get_action().takes_values();
        arg.allow_negative_numbers(takes_values)
    };
    command.mut_args(arg).mut_subcommands(with_negative_numbers)
}

/// Parses the command line and runs it.
pub fn main() -> ExitCode {
    let matches = command_line().try_get_matches();
    let cli = matches.and_then(|matches| Cli::from_arg_matches(&matches));
    let cli = cli.unwrap_or_else(|error| words::explain(error).exit());
    end(cli.command.run(&mut command_line()))
}

/// Says why a run failed; how it ended, for the shell.
pub fn end(outcome: miette::Result<Exit>) -> ExitCode {
    match outcome {
        Ok(exit) => exit.into(),
        // Whoever read our output has seen enough (`| head`): not an error.
        Err(report) if report.is::<output::PipeClosed>() => Exit::Ok.into(),
        Err(report) => match report.downcast_ref() {
            Some(link::Ended(exit)) => (*exit).into(),
            None => {
                output::say_report(&report);
                Exit::BadInput.into()
            }
        },
    }
}

#[cfg(test)]
mod tests {
    #[test]
    fn the_command_line_is_consistent() {
        super::command_line().debug_assert();
    }

    #[test]
    fn a_negative_number_is_refused_with_the_range_that_is_allowed() {
        let words = ["rollwalk", "simulate", "it.plan.json", "--cycles", "-2"];
        let error = super::command_line().try_get_matches_from(words).unwrap_err().to_string();
        assert!(error.contains("-2 is not in 1..=10000"), "{error}");
        let words = ["rollwalk-sim", "it.toml", "--bus", "sim", "--slope", "-90"];
        let error = super::sim::command_line().try_get_matches_from(words).unwrap_err().to_string();
        assert!(error.contains("invalid value '-90'"), "{error}");
    }
}
