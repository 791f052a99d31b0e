//! Chapters of the book that are generated from the code: help texts of all commands, and the crates with links to rustdoc.

use super::site::RUSTDOC;
use crate::{shell, workspace};
use serde_json::Value;
use std::fmt::Write as _;
use std::path::Path;

/// Programs that users run. `rollwalk` also runs a third program, which must be in the same folder.
const PROGRAMS: [&str; 2] = ["rollwalk", "rollwalk-sim"];

/// Width of a line in a chapter, characters.
const WIDTH: &str = "84";

/// Generates text to append to chapters of the book: file of the chapter, and text.
///
/// # Errors
/// Returns an error if the programs cannot be built.
pub fn chapters() -> Result<Vec<(&'static str, String)>, String> {
    let mut helps = String::new();
    workspace::program("apps/bench", "rollwalk-bench")?;
    for name in PROGRAMS {
        let program = workspace::program("cli", name)?.path.to_string_lossy().into_owned();
        commands(&program, &mut vec![name.to_owned()], &mut helps)?;
    }
    let metadata =
        shell::output(&mut shell::cargo(&["metadata", "--no-deps", "--format-version", "1"]))?;
    Ok(vec![("help-texts.md", helps), ("crates.md", crates(&metadata)?)])
}

/// Appends the help of a command and its subcommands, each under a heading.
fn commands(program: &str, words: &mut Vec<String>, into: &mut String) -> Result<(), String> {
    let mut ask = shell::command(program, &words[1..]);
    let help = shell::output(ask.arg("--help").env("COLUMNS", WIDTH).env("NO_COLOR", "1"))?;
    let _ = write!(into, "\n## {}\n\n```text\n{}\n```\n", words.join(" "), help.trim_end());
    for below in subcommands(&help) {
        words.push(below);
        commands(program, words, into)?;
        words.pop();
    }
    Ok(())
}

/// Returns the subcommands that clap lists in a help text, except `help`.
fn subcommands(help: &str) -> Vec<String> {
    descriptions(help).into_iter().map(|(name, _)| name).collect()
}

/// Returns the subcommands that clap lists in a help text, except `help`, each with its description.
pub fn descriptions(help: &str) -> Vec<(String, String)> {
    let mut found: Vec<(String, String)> = Vec::new();
    let lines = help.lines().skip_while(|line| *line != "Commands:").skip(1);
    for line in lines.take_while(|line| !line.is_empty()) {
        let name = line.strip_prefix("  ").and_then(|line| line.split(' ').next());
        match (name, found.last_mut()) {
            (Some(name), _) if !name.is_empty() => {
                found.push((name.to_owned(), line[2 + name.len()..].trim().to_owned()));
            }
            // A description of several lines.
            (_, Some((_, about))) => *about = format!("{about} {}", line.trim()),
            (_, None) => {}
        }
    }
    found.retain(|(name, _)| name != "help");
    found
}

/// Table of the workspace's library crates, with their descriptions and links to their pages.
fn crates(metadata: &str) -> Result<String, String> {
    let metadata: Value = serde_json::from_str(metadata).map_err(|error| error.to_string())?;
    let mut table = "\n## Documentation of all crates\n\n| crate | is |\n|---|---|\n".to_owned();
    for package in metadata["packages"].as_array().into_iter().flatten() {
        let targets = package["targets"].as_array().into_iter().flatten();
        let mut libraries = targets.filter(|target| target["kind"][0] == "lib");
        if let (Some(library), Some(name)) = (libraries.next(), package["name"].as_str()) {
            let module = library["name"].as_str().unwrap_or(name).replace('-', "_");
            let what = package["description"].as_str().unwrap_or_default();
            let _ = writeln!(table, "| [`{name}`]({RUSTDOC}/{module}/index.html) | {what} |");
        }
    }
    Ok(table)
}

/// Copies rustdoc's pages of the workspace into the site.
///
/// # Errors
/// Returns rustdoc's warnings, or an error if the pages cannot be copied.
pub fn rustdoc(site: &Path) -> Result<(), String> {
    let mut doc = workspace::cargo(&["doc", "--no-deps"]);
    shell::run(doc.env("RUSTDOCFLAGS", "-D warnings"))?;
    let pages = shell::target_folder().join("doc");
    shell::run(shell::command("cp", &["-rT"]).arg(pages).arg(site.join(RUSTDOC)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn subcommands_are_those_of_the_help() {
        let help = "Check\n\nCommands:\n  check   Validate\n          it: sag\n  import  Convert\n  help    Print\n\nOptions:\n  -h\n";
        assert_eq!(subcommands(help), ["check", "import"]);
        assert!(subcommands("Options:\n  -h\n").is_empty());
    }

    #[test]
    fn crates_have_a_link_to_their_page() {
        let metadata = r#"{"packages": [{"name": "a-b", "description": "Bees", "targets": [{"kind": ["lib"], "name": "a_b"}]},
            {"name": "c", "targets": [{"kind": ["bin"], "name": "c"}]}]}"#;
        let table = crates(metadata).unwrap();
        assert!(table.ends_with("| [`a-b`](rustdoc/a_b/index.html) | Bees |\n"), "{table}");
        assert_eq!(table.lines().count(), 6);
    }
}
