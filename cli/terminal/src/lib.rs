//! Terminal side of Rollwalk's programs: files, terminal, clock and Ctrl-C, which the other libraries must not touch.
//!
//! `rollwalk`, `rollwalk-sim`, `rollwalk-bench` and `rollwalk-ros2` share the same exit codes, messages, input files and bus
//! options. Results go to stdout, progress to stderr; a run ends with an [`Exit`].
//!
//! | modules | content |
//! |---|---|
//! | [`exit`], [`output`], [`progress`], [`interrupt`] | exit codes, results and reports, progress bars, Ctrl-C |
//! | [`files`], [`kind`], [`inputs`], [`shipped`] | reading and writing files, kinds of files, validated inputs, files in the program |
//! | [`link`], [`keys`], [`packed`] | bus options and sessions, link keys, names from a motion library |
//! | [`planning`], [`choices`], [`problem`] | planning with progress, its options, problem files |
//! | [`generated`], [`examples`] | manual pages and completions, examples in help texts |

pub mod choices;
pub mod examples;
pub mod exit;
pub mod files;
pub mod generated;
pub mod inputs;
pub mod interrupt;
pub mod keys;
pub mod kind;
pub mod link;
pub mod output;
pub mod packed;
pub mod planning;
pub mod problem;
pub mod progress;
pub mod shipped;

pub use exit::Exit;

use std::process::ExitCode;

/// Reports a failed run and converts its end into the exit code for the shell.
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

/// Command line with exit codes at the end of every long help, and negative numbers allowed as values.
///
/// A negative number outside a range is then refused with the range, not as an unknown option.
pub fn with_common_help(command: clap::Command) -> clap::Command {
    let examples = command.get_after_long_help().map(|text| format!("{text}\n\n"));
    let help = examples.unwrap_or_default() + exit::HELP;
    let command = command.after_long_help(help).mut_args(|arg| {
        let takes_values = arg.get_action().takes_values();
        arg.allow_negative_numbers(takes_values)
    });
    command.mut_subcommands(with_common_help)
}
