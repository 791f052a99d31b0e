//! `rollwalk completions SHELL`: prints a completion script.

use crate::sim;
use clap::ValueEnum;
use rollwalk_terminal::Exit;
use rollwalk_terminal::generated::{self, Shell};

/// Print a completion script for your shell.
#[derive(clap::Args)]
#[command(after_long_help = "\
Examples:
  rollwalk completions bash > ~/.local/share/bash-completion/completions/rollwalk
  rollwalk completions zsh > ~/.zfunc/_rollwalk
  rollwalk completions fish > ~/.config/fish/completions/rollwalk.fish
  rollwalk completions fish --of rollwalk-sim > ~/.config/fish/completions/rollwalk-sim.fish")]
pub struct Args {
    /// Shell to complete for.
    shell: Shell,
    /// Program whose command line is completed.
    #[arg(long, value_name = "PROGRAM", default_value = "rollwalk")]
    of: Program,
}

/// Program of this package.
#[derive(Clone, Copy, ValueEnum)]
enum Program {
    /// Command-line tools.
    Rollwalk,
    /// Simulated robot.
    RollwalkSim,
}

/// Prints the script.
pub fn run(args: &Args, root: &mut clap::Command) -> miette::Result<Exit> {
    let mut simulator = sim::command_line();
    let command = match args.of {
        Program::Rollwalk => root,
        Program::RollwalkSim => &mut simulator,
    };
    generated::completions(command, args.shell)?;
    Ok(Exit::Ok)
}
