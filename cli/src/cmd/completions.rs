//! `rollwalk completions SHELL`: prints a completion script.

use crate::{Exit, output};
use clap_complete::Shell;

/// Print a completion script for your shell.
#[derive(clap::Args)]
#[command(after_long_help = "\
Examples:
  rollwalk completions bash > ~/.local/share/bash-completion/completions/rollwalk
  rollwalk completions zsh > ~/.zfunc/_rollwalk
  rollwalk completions fish > ~/.config/fish/completions/rollwalk.fish")]
pub struct Args {
    /// The shell.
    shell: Shell,
}

/// Prints the script.
pub fn run(args: &Args, command: &mut clap::Command) -> miette::Result<Exit> {
    let mut script = Vec::new();
    clap_complete::generate(args.shell, command, "rollwalk", &mut script);
    output::print(&String::from_utf8_lossy(&script))?;
    Ok(Exit::Ok)
}
