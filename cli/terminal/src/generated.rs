//! Files that installations generate from a command line: manual pages, and completions of shells.

use crate::{files, output};
use clap::Command;
use std::path::Path;

pub use clap_complete::Shell;

/// Writes the manual pages of a program and its subcommands into a folder, which is made if it is missing.
///
/// # Errors
/// The folder cannot be written to.
pub fn manual(program: Command, folder: &Path) -> miette::Result<()> {
    files::make_folder(folder)?;
    clap_mangen::generate_to(program, folder)
        .map_err(|error| files::cannot_write(folder, error))?;
    Ok(())
}

/// Prints the script with which a shell completes the words of a program.
///
/// # Errors
/// Standard output is closed.
pub fn completions(program: &mut Command, shell: Shell) -> miette::Result<()> {
    let name = program.get_name().to_owned();
    let mut script = Vec::new();
    clap_complete::generate(shell, program, name, &mut script);
    output::print(&String::from_utf8_lossy(&script))?;
    Ok(())
}
