//! Command line of `rollwalk`: connects planner, library, bus and simulated robot. It also accesses files, the terminal, the
//! clock and Ctrl-C, which those crates must not touch.
//!
//! `cli/src/cmd` has one file per subcommand, each with its arguments and a `run`; `apps` runs separate programs. [`sim`] is
//! the other binary, `rollwalk-sim`. Code that several programs share is in `rollwalk-terminal`.

mod apps;
mod buses;
mod cmd;
mod excursion;
mod gamepad;
mod live;
mod picture;
mod planned;
mod played;
mod remedies;
mod signing;
pub mod sim;
mod studio;
mod system;
mod terrain;
mod tour;
mod words;
mod world_log;

use clap::{CommandFactory, Parser};
use rollwalk_terminal::{Exit, arguments, end, with_common_help};
use std::process::ExitCode;

/// Make robots with legs and wheels move.
#[derive(Parser)]
#[command(name = "rollwalk", version, max_term_width = 100)]
#[command(after_long_help = "\
Where to begin:
  rollwalk demo --out demo-out          everything, end to end, without hardware
  rollwalk robot check my-robot.toml    checks a robot file
  rollwalk plan my-motion.toml -o my-motion.plan.json")]
struct Cli {
    #[command(subcommand)]
    command: cmd::Command,
}

/// Command line; the long help of every subcommand ends with the exit codes.
pub fn command_line() -> clap::Command {
    with_common_help(Cli::command(), &exits)
}

/// Additional exit codes of a command, beside 0, 1, 2 and 130; `Exit::Ok` if the command runs until a signal ends it.
fn exits(path: &str) -> &'static [Exit] {
    match path.strip_prefix("rollwalk ").unwrap_or_default() {
        "demo" => &[Exit::DoesNotHold, Exit::OutOfBounds],
        "plan" | "report" | "simulate" | "retarget" | "library build" => &[Exit::DoesNotHold],
        "design edit" | "design keep" | "design optimise" => &[Exit::DoesNotHold],
        "bench" => &[Exit::DoesNotHold, Exit::OutOfBounds],
        "drive" => &[Exit::DoesNotHold, Exit::NotDone],
        "studio" => &[Exit::Ok],
        "monitor" | "console" => &[Exit::Ok, Exit::NotDone],
        "control" | "discover" | "flash" | "send" | "gains" | "doctor" | "estop" | "clear"
        | "disarm" | "pause" | "resume" | "return" => &[Exit::NotDone],
        _ => &[],
    }
}

/// Parses the command line and runs it.
pub fn main() -> ExitCode {
    let words: Vec<_> = std::env::args_os().collect();
    let explain = |error| words::explain(error, &command_line());
    let cli: miette::Result<Cli> = arguments::parse(command_line(), &words, explain);
    end(cli.and_then(|cli| cli.command.run(&mut command_line())))
}

#[cfg(test)]
mod tests {
    use rollwalk_terminal::examples;

    #[test]
    fn the_command_line_is_consistent() {
        super::command_line().debug_assert();
    }

    /// Checks that the help text of a command lists only exit codes that the command can return.
    #[test]
    fn exit_codes_are_those_of_the_command() {
        let command = super::command_line();
        let codes = |path: &[&str]| {
            let of = path.iter().fold(&command, |of, name| of.find_subcommand(name).unwrap());
            let help = of.get_after_long_help().unwrap().to_string();
            let lines = help.lines().skip_while(|line| *line != "Exit codes:").skip(1);
            lines.map(|line| line.split_whitespace().next().unwrap().to_owned()).collect::<Vec<_>>()
        };
        assert_eq!(codes(&["robot", "check"]), ["0", "1", "2", "130"]);
        assert_eq!(codes(&["keys", "new"]), ["0", "1", "2", "130"]);
        assert_eq!(codes(&["estop"]), ["0", "1", "2", "5", "130"]);
        assert_eq!(codes(&["monitor"]), ["0", "1", "2", "5", "130"]);
        assert_eq!(codes(&["plan"]), ["0", "1", "2", "3", "130"]);
        assert_eq!(codes(&["demo"]), ["0", "1", "2", "3", "4", "130"]);
        // A command with subcommands lists the codes of all of them.
        assert_eq!(codes(&["library"]), ["0", "1", "2", "3", "130"]);
        assert_eq!(codes(&[]), ["0", "1", "2", "3", "4", "5", "130"]);
    }

    /// Checks the help texts of the programs that run until Ctrl-C; `tests/integration` signals them.
    #[test]
    fn a_signal_ends_only_endless_programs_with_0() {
        let command = super::command_line();
        let help = |name| command.find_subcommand(name).unwrap().get_after_long_help().unwrap();
        let ends_with_0 = |help: String| help.contains("0    done, or ended by Ctrl-C");
        for name in ["studio", "monitor", "console"] {
            assert!(ends_with_0(help(name).to_string()), "{name}");
        }
        assert!(ends_with_0(super::sim::command_line().get_after_long_help().unwrap().to_string()));
        assert!(!ends_with_0(help("drive").to_string()));
        assert!(!ends_with_0(command.get_after_long_help().unwrap().to_string()));
    }

    #[test]
    fn every_command_has_an_example() {
        assert_eq!(examples::missing(&super::command_line(), "rollwalk"), [""; 0]);
    }

    #[test]
    fn every_example_is_understood() {
        let (rollwalk, simulator) = (super::command_line(), super::sim::command_line());
        let examples = [examples::of(&rollwalk), examples::of(&simulator)].concat();
        assert!(examples.len() > 60, "{} examples", examples.len());
        for words in examples {
            let command = if words[0] == "rollwalk-sim" { &simulator } else { &rollwalk };
            let parsed = command.clone().try_get_matches_from(&words);
            assert!(parsed.is_ok(), "{}: {}", words.join(" "), parsed.unwrap_err());
        }
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
