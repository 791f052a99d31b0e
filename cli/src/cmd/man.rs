//! `rollwalk man`: writes the manual pages of all commands.

use crate::sim;
use rollwalk_terminal::{Exit, generated, output};
use std::path::{Path, PathBuf};

/// Write the manual pages of all commands and of rollwalk-sim, one page for each.
#[derive(clap::Args)]
#[command(after_long_help = "\
Examples:
  rollwalk man --out ~/.local/share/man/man1     for `man rollwalk-plan`
  rollwalk man --out man                         `man man/rollwalk.1` shows the first of them")]
pub struct Args {
    /// Output folder.
    #[arg(long, value_name = "FOLDER")]
    out: PathBuf,
}

/// Writes the pages; `root` is the whole command line.
pub fn run(args: &Args, root: &clap::Command) -> miette::Result<Exit> {
    write(&args.out, root)?;
    output::line(&format!("wrote the manual pages to {}", args.out.display()))?;
    Ok(Exit::Ok)
}

fn write(out: &Path, root: &clap::Command) -> miette::Result<()> {
    generated::manual(root.clone(), out)?;
    generated::manual(sim::command_line(), out)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::command_line;
    use std::fs;

    /// Collects the names of the pages of a command and its subcommands.
    fn pages(command: &clap::Command, above: &str, into: &mut Vec<String>) {
        let name = format!("{above}{}", command.get_name());
        command.get_subcommands().for_each(|below| pages(below, &format!("{name}-"), into));
        into.push(format!("{name}.1"));
    }

    #[test]
    fn every_command_has_a_page_with_its_examples() {
        let folder = tempfile::tempdir().unwrap();
        write(folder.path(), &command_line()).unwrap();
        let mut names = Vec::new();
        pages(&command_line(), "", &mut names);
        pages(&sim::command_line(), "", &mut names);
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), names.len());
        for name in &names {
            let page = fs::read_to_string(folder.path().join(name)).unwrap();
            assert!(page.contains("\nExit codes:\n"), "{name}:\n{page}");
        }
        let page = fs::read_to_string(folder.path().join("rollwalk-robot-check.1")).unwrap();
        assert!(page.contains("rollwalk robot check"), "{page}");
    }
}
