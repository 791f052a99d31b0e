//! Rules of this repository that the compiler does not check, each in its own module, applied to the files of the checkout.

mod circles;
mod commands;
mod comments;
mod links;
mod map;
mod module_docs;
mod names;
mod pages;
mod paths;
mod prose;
mod subject;

use crate::checkout;
use crate::docs::book::Books;
use crate::shell;
use clap::CommandFactory;
use std::path::Path;

/// Checks every rule.
///
/// # Errors
/// Returns all violations, one per line, each with its file and the remedy.
pub fn check(root: &Path) -> Result<(), String> {
    let files = checkout::text_files(root)?;
    let metadata =
        shell::output(&mut shell::cargo(&["metadata", "--no-deps", "--format-version", "1"]))?;
    let mut violations = module_docs::violations(&files);
    violations.extend(paths::machine_paths(&files));
    violations.extend(paths::dead_references(&files, |path| root.join(path).exists()));
    violations.extend(map::violations(&files, &metadata)?);
    violations.extend(circles::violations(&files));
    violations.extend(prose::violations(&files));
    violations.extend(comments::violations(&files));
    violations.extend(names::violations(&files));
    violations.extend(pages::violations(&files));
    violations.extend(subject::violations());
    let (dead, links) = links::violations(&files, |path| root.join(path).exists());
    let (wrong, commands) = commands::violations(&files, &crate::Cli::command());
    violations.extend(dead.into_iter().chain(wrong));
    violations.extend(Books::read(&files).err());
    if violations.is_empty() {
        let count = files.len();
        eprintln!(
            "{count} files, {links} links and {commands} commands follow the rules of this repository"
        );
        Ok(())
    } else {
        Err(violations.join("\n"))
    }
}

#[cfg(test)]
mod tests {
    #[test]
    fn this_checkout_follows_the_house_rules() {
        super::check(&crate::shell::workspace_root()).unwrap_or_else(|why| panic!("{why}"));
    }
}
