//! Check of paths in text: no absolute path of a developer's machine in any file, and no dead reference in the documents.

use crate::checkout::TextFile;
use std::collections::BTreeSet;

/// Home and work folders of machines, split so that this file does not contain them.
const MACHINE_ROOTS: [[&str; 2]; 4] =
    [["/ho", "me/"], ["/ro", "ot/"], ["/wo", "rk/"], ["/Us", "ers/"]];

/// Lines that contain a folder of a developer's machine.
pub fn machine_paths(files: &[TextFile]) -> Vec<String> {
    let roots = MACHINE_ROOTS.map(|parts| parts.concat());
    let mut found = Vec::new();
    for file in files {
        for (number, line) in file.text.lines().enumerate() {
            for root in &roots {
                if starts_a_path(line, root) {
                    found.push(format!(
                        "{}:{}: `{root}...` exists on one machine only; write a path from the \
                         checkout's root",
                        file.path,
                        number + 1
                    ));
                }
            }
        }
    }
    found
}

/// True if `root` starts a path in `line`, instead of being in its middle (`docs/home/`).
fn starts_a_path(line: &str, root: &str) -> bool {
    line.match_indices(root).any(|(at, _)| {
        !line[..at].ends_with(|c: char| c.is_alphanumeric() || matches!(c, '.' | '_' | '-' | '*'))
    })
}

/// Extensions of source files, which must exist in this checkout wherever they are mentioned.
const SOURCES: [&str; 4] = [".rs", ".py", ".ts", ".mjs"];

/// Code spans in Markdown files that name a missing source file, or a missing file or folder below a top-level folder of this
/// checkout.
pub fn dead_references(files: &[TextFile], exists: impl Fn(&str) -> bool) -> Vec<String> {
    let folders: BTreeSet<&str> =
        files.iter().filter_map(|file| Some(file.path.split_once('/')?.0)).collect();
    let mut found = Vec::new();
    for file in files.iter().filter(|file| file.path.ends_with(".md")) {
        for (number, line) in file.text.lines().enumerate() {
            // Every second piece between backticks is a code span.
            for span in line.split('`').skip(1).step_by(2) {
                let Some((folder, _)) = span.split_once('/') else { continue };
                let is_pattern = span.contains(|c: char| "*<>{} ".contains(c) || c.is_uppercase());
                let is_ours =
                    folders.contains(folder) || SOURCES.iter().any(|end| span.ends_with(end));
                if is_ours
                    && !is_pattern
                    && !exists(span)
                    && !exists(&resolve_relative(&file.path, span))
                {
                    found.push(format!("{}:{}: `{span}` does not exist", file.path, number + 1));
                }
            }
        }
    }
    found
}

/// Path of a file that a page names relative to its own folder.
fn resolve_relative(page: &str, named: &str) -> String {
    page.rsplit_once('/').map_or_else(String::new, |(folder, _)| format!("{folder}/{named}"))
}

#[cfg(test)]
mod tests {
    use crate::checkout::file;

    #[test]
    fn machine_paths_are_found_where_a_path_starts() {
        let home = ["/ho", "me/"].concat();
        let text = format!("fine: docs{home}x\nbad: `{home}ada/rollwalk`\n");
        let found = super::machine_paths(&[file("README.md", &text)]);
        assert_eq!(found.len(), 1, "{found:?}");
        assert!(found[0].starts_with("README.md:2"));
    }

    #[test]
    fn references_to_missing_files_are_named() {
        let text = "See `robot/src/lib.rs`, `robot/src/gone.rs`, `moved/src/lib.rs`, `robots/*.toml`, `N/A` and `and/or`.\n";
        let files = [file("README.md", text), file("robot/src/lib.rs", "")];
        let found = super::dead_references(&files, |path| path == "robot/src/lib.rs");
        let gone = ["robot/src/gone.rs", "moved/src/lib.rs"];
        assert_eq!(found, gone.map(|path| format!("README.md:1: `{path}` does not exist")));
    }
}
