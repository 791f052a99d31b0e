//! Check that all `cargo xtask` commands in the documents are valid. `tests/integration/pages.rs` checks those of `rollwalk`,
//! whose command line it links.

use crate::checkout::TextFile;
use crate::markdown::Page;

/// Returns invalid commands in shell blocks, and the number of valid ones.
pub fn violations(files: &[TextFile], command: &clap::Command) -> (Vec<String>, usize) {
    let (mut found, mut checked) = (Vec::new(), 0);
    for file in files.iter().filter(|file| file.path.ends_with(".md")) {
        for block in Page::parse(&file.text).blocks {
            if block.info.split_whitespace().next() != Some("sh") {
                continue;
            }
            for (number, line) in block.code.lines().enumerate() {
                let place = format!("{}:{}", file.path, block.line + number);
                let Some(words) = shlex::split(line) else {
                    found.push(format!("{place}: close the quote in `{line}`"));
                    continue;
                };
                let Some(words) = words.strip_prefix(&["cargo".to_owned(), "xtask".to_owned()])
                else {
                    continue;
                };
                checked += 1;
                let typed = std::iter::once("cargo xtask").chain(words.iter().map(String::as_str));
                if let Err(error) = command.clone().try_get_matches_from(typed) {
                    let error = error.to_string();
                    let why = error.lines().next().unwrap_or_default();
                    found.push(format!("{place}: `{line}`: {why}"));
                }
            }
        }
    }
    (found, checked)
}

#[cfg(test)]
mod tests {
    use crate::checkout::file;
    use clap::{Arg, Command};

    #[test]
    fn unknown_commands_and_options_are_named() {
        let command = Command::new("cargo xtask")
            .subcommand(Command::new("test").arg(Arg::new("only").long("only")));
        let text = "```sh\ncargo xtask test --only fmt   # one\ncargo xtask tset\n```\n```text\ncargo xtask no\n```\n\
                    ```sh not-run: why\ncargo xtask test --olny fmt\n```\n";
        let (found, checked) = super::violations(&[file("a.md", text)], &command);
        assert_eq!((found.len(), checked), (2, 3), "{found:?}");
        assert!(found[0].starts_with("a.md:3: `cargo xtask tset`: error: unrecognized subcommand"));
        assert!(found[1].starts_with("a.md:9: `cargo xtask test --olny fmt`"), "{found:?}");
    }
}
