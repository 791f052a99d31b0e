//! Terminal side of Rollwalk's programs. Only this crate and the programs access files, the terminal, the clock and Ctrl-C; the
//! other libraries do not.
//!
//! `rollwalk`, `rollwalk-sim`, `rollwalk-bench` and `rollwalk-ros2` share exit codes, messages, input files and bus options.
//! Results are written to stdout, progress to stderr; a run ends with an [`Exit`].
//!
//! | modules | content |
//! |---|---|
//! | [`arguments`], [`exit`], [`output`], [`progress`], [`interrupt`] | parsing, exit codes, results and reports, progress bars, Ctrl-C |
//! | [`files`], [`kind`], [`inputs`], [`shipped`] | reading and writing files, kinds of files, validated inputs, files in the program |
//! | [`link`], [`keys`], [`validated_library`] | bus options and sessions, link keys, names from a motion library |
//! | [`planning`], [`choices`], [`problem`] | planning with progress, its options, problem files |
//! | [`generated`], [`examples`], [`spelling`] | manual pages and completions, examples in help texts, misspelled names |

pub mod arguments;
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
pub mod planning;
pub mod problem;
pub mod progress;
pub mod shipped;
pub mod spelling;
pub mod validated_library;

pub use exit::Exit;

use std::process::ExitCode;

/// Prints the report of a failed run, and converts the outcome to the exit code of the process.
pub fn end(outcome: miette::Result<Exit>) -> ExitCode {
    match outcome {
        Ok(exit) => exit.into(),
        // The reader of our output has closed the pipe (`| head`). This is not an error.
        Err(report) if report.is::<output::PipeClosed>() => Exit::Ok.into(),
        Err(report) => match report.downcast_ref() {
            Some(link::FailedSession(exit)) => (*exit).into(),
            None => {
                output::print_report(&report);
                Exit::BadInput.into()
            }
        },
    }
}

/// Adds exit codes to the end of every long help, and allows negative numbers as values.
///
/// `exits` returns the additional codes of a command by its full name, beside 0, 1, 2 and 130. [`Exit::Ok`] marks a command
/// that runs until a signal ends it, which then exits with 0. A command with subcommands lists the codes of its subcommands,
/// too. Negative numbers are allowed so that a value outside its range is refused with the range,
/// not as an unknown option.
pub fn with_common_help(
    command: clap::Command,
    exits: &dyn Fn(&str) -> &'static [Exit],
) -> clap::Command {
    let name = command.get_name().to_owned();
    common_help(command, &name, exits).0
}

fn common_help(
    command: clap::Command,
    path: &str,
    exits: &dyn Fn(&str) -> &'static [Exit],
) -> (clap::Command, Vec<Exit>) {
    let mut all = exits(path).to_vec();
    let command = command.mut_subcommands(|below| {
        let path = format!("{path} {}", below.get_name());
        let (below, exits) = common_help(below, &path, exits);
        all.extend(exits.into_iter().filter(|exit| *exit != Exit::Ok));
        below
    });
    let examples = command.get_after_long_help().map(|text| format!("{text}\n\n"));
    let help = examples.unwrap_or_default() + &exit::help(&all);
    let command = command.after_long_help(help).mut_args(|arg| {
        let takes_values = arg.get_action().takes_values();
        arg.allow_negative_numbers(takes_values)
    });
    (command, all)
}
