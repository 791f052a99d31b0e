//! The subcommands, one file each.

mod bench;
mod buses;
mod completions;
mod demo;
mod export;
mod failsafe;
mod import;
mod library;
mod plan;
mod plot;
mod report;
mod robot;

use crate::Exit;

/// What to do.
#[derive(clap::Subcommand)]
pub enum Command {
    Demo(demo::Args),
    Robot(robot::Args),
    Plan(plan::Args),
    Report(report::Args),
    Plot(plot::Args),
    Export(export::Args),
    Library(library::Args),
    Failsafe(failsafe::Args),
    Bench(bench::Args),
    Completions(completions::Args),
}

impl Command {
    /// Runs the subcommand; `root` is the whole command line, for the completion scripts.
    ///
    /// # Errors
    /// Bad input and files that cannot be read or written, as reports for the terminal.
    pub fn run(&self, root: &mut clap::Command) -> miette::Result<Exit> {
        match self {
            Command::Demo(args) => demo::run(args),
            Command::Robot(args) => robot::run(args),
            Command::Plan(args) => plan::run(args),
            Command::Report(args) => report::run(args),
            Command::Plot(args) => plot::run(args),
            Command::Export(args) => export::run(args),
            Command::Library(args) => library::run(args),
            Command::Failsafe(args) => failsafe::run(args),
            Command::Bench(args) => bench::run(args),
            Command::Completions(args) => completions::run(args, root),
        }
    }
}
