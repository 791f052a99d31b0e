//! `cargo xtask`: what the README and CI run.
//!
//! `cargo xtask test` is the whole check, step by step; [`steps`] lists the steps, [`tidy`] holds the
//! house rules that no compiler checks, [`bare_metal`] builds the controller's crates for the Cortex-M4.

mod bare_metal;
mod debian;
mod shell;
mod steps;
mod tidy;

use clap::{Parser, Subcommand};
use std::process::ExitCode;

/// Development tasks of the Rollwalk workspace.
#[derive(Parser)]
#[command(name = "cargo xtask", bin_name = "cargo xtask")]
struct Cli {
    #[command(subcommand)]
    task: Task,
}

#[derive(Subcommand)]
enum Task {
    /// Check everything that a change must pass: formatting, house rules, lints, docs, the bare-metal
    /// build and all tests. Stops at the first failure and says how to run that step alone.
    Test {
        /// Run one step only.
        #[arg(long, value_name = "STEP")]
        only: Option<steps::Step>,
    },
}

fn main() -> ExitCode {
    let Cli { task: Task::Test { only } } = Cli::parse();
    match steps::run(only) {
        Ok(()) => ExitCode::SUCCESS,
        Err(failure) => {
            eprintln!("{failure}");
            ExitCode::FAILURE
        }
    }
}
