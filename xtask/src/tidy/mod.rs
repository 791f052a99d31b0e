//! House rules that no compiler checks, each in its own module, run over the files of the checkout.

mod circles;
mod commands;
mod links;
mod map;
mod module_docs;
mod paths;
mod prose;

use crate::docs::book::Book;
use crate::shell;
use clap::CommandFactory;
use ignore::WalkBuilder;
use std::fs;
use std::path::Path;

/// A text file of the checkout: path from the root with `/`, and content.
pub struct TextFile {
    /// Path from the workspace root.
    pub path: String,
    /// The whole text.
    pub text: String,
}

/// Checks every rule.
///
/// # Errors
/// All violations, one a line, each with its file and what would be right.
pub fn check(root: &Path) -> Result<(), String> {
    let files = text_files(root)?;
    let metadata =
        shell::output(&mut shell::cargo(&["metadata", "--no-deps", "--format-version", "1"]))?;
    let mut violations = module_docs::violations(&files);
    violations.extend(paths::machine_paths(&files));
    violations.extend(paths::dead_references(&files, |path| root.join(path).exists()));
    violations.extend(map::violations(&files, &metadata)?);
    violations.extend(circles::violations(&files));
    violations.extend(prose::violations(&files));
    let (dead, links) = links::violations(&files, |path| root.join(path).exists());
    let (wrong, commands) = commands::violations(&files, &crate::Cli::command());
    violations.extend(dead.into_iter().chain(wrong));
    violations.extend(Book::read(&files).err());
    if violations.is_empty() {
        let count = files.len();
        eprintln!("{count} files, {links} links and {commands} commands follow the house rules");
        Ok(())
    } else {
        Err(violations.join("\n"))
    }
}

/// Every text file that git does not ignore, in path order. Works without git, too.
///
/// # Errors
/// The checkout cannot be listed.
pub fn text_files(root: &Path) -> Result<Vec<TextFile>, String> {
    let skip = |name: &str| name == ".git" || name == "target";
    let walk = WalkBuilder::new(root)
        .hidden(false)
        .require_git(false)
        .sort_by_file_path(Path::cmp)
        .filter_entry(move |entry| !entry.file_name().to_str().is_some_and(skip))
        .build();
    let mut files = Vec::new();
    for entry in walk {
        let entry = entry.map_err(|error| format!("cannot list the checkout: {error}"))?;
        if !entry.file_type().is_some_and(|kind| kind.is_file()) {
            continue;
        }
        // What is not UTF-8 is an image or golden bytes: no rule speaks of those.
        let Ok(text) = fs::read_to_string(entry.path()) else { continue };
        let path = entry.path().strip_prefix(root).map_err(|error| error.to_string())?;
        let path = path.to_string_lossy().replace('\\', "/");
        files.push(TextFile { path, text });
    }
    Ok(files)
}

/// A file for the rules' own tests.
#[cfg(test)]
pub fn file(path: &str, text: &str) -> TextFile {
    TextFile { path: path.into(), text: text.into() }
}

#[cfg(test)]
mod tests {
    #[test]
    fn this_checkout_follows_the_house_rules() {
        super::check(&crate::shell::workspace_root()).unwrap_or_else(|why| panic!("{why}"));
    }
}
