//! The `rollwalk` command line: joins planner, library, bus and simulated robot, and owns what those
//! must not touch: files, the terminal, the clock and Ctrl-C.
//!
//! One file per subcommand in [`cmd`], each with its arguments and a `run`. Results go to stdout,
//! progress to stderr; how a run ends is an [`Exit`].

mod cmd;
mod exit;
mod files;
mod inputs;
mod interrupt;
mod output;

pub use exit::Exit;

use clap::{CommandFactory, Parser};
use std::process::ExitCode;

/// Make robots with legs and wheels move.
#[derive(Parser)]
#[command(name = "rollwalk", version, max_term_width = 100, after_help = exit::HELP)]
#[command(after_long_help = concat_help())]
struct Cli {
    #[command(subcommand)]
    command: cmd::Command,
}

/// Long help ends with where to begin.
fn concat_help() -> String {
    format!(
        "Where to begin:\n  \
         rollwalk demo --out demo-out          everything, end to end, without hardware\n  \
         rollwalk robot check my-robot.toml    is my robot file right?\n  \
         rollwalk plan my-motion.toml -o my-motion.plan.json\n\n{}",
        exit::HELP
    )
}

/// Parses the command line and runs it.
pub fn main() -> ExitCode {
    let outcome = Cli::parse().command.run(&mut Cli::command());
    match outcome {
        Ok(exit) => exit.into(),
        // Whoever read our output has seen enough (`| head`): not an error.
        Err(report) if report.is::<output::PipeClosed>() => Exit::Ok.into(),
        Err(report) => {
            eprintln!("{report:?}");
            Exit::BadInput.into()
        }
    }
}

#[cfg(test)]
mod tests {
    use clap::CommandFactory;

    #[test]
    fn the_command_line_is_consistent() {
        super::Cli::command().debug_assert();
    }
}
