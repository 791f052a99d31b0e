//! Files generated from a command line for installation: manual pages and shell completions.

use crate::{files, output};
use clap::Command;
use std::path::Path;

pub use clap_complete::Shell;

/// Writes the manual pages of a program and its subcommands into a folder, which is created if it is missing.
///
/// # Errors
/// Returns an error if the folder cannot be written to.
pub fn manual(program: Command, folder: &Path) -> miette::Result<()> {
    files::make_folder(folder)?;
    clap_mangen::generate_to(program, folder)
        .map_err(|error| files::cannot_write(folder, error))?;
    Ok(())
}

/// Prints the completion script of a program for a shell.
///
/// # Errors
/// Returns an error if standard output is closed.
pub fn completions(program: &mut Command, shell: Shell) -> miette::Result<()> {
    let name = program.get_name().to_owned();
    let mut script = Vec::new();
    clap_complete::generate(shell, program, name, &mut script);
    output::print(&String::from_utf8_lossy(&script))?;
    Ok(())
}
