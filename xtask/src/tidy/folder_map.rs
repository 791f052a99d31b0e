//! The folder map of `ARCHITECTURE.md` names exactly the folders that exist.
//!
//! A row of the map is a table row whose first cell is one folder: `` | `planner/` | ... ``.

use crate::checkout::TextFile;
use std::collections::BTreeSet;

/// Folders that the map lacks, and rows without a folder.
pub fn violations(files: &[TextFile]) -> Vec<String> {
    let Some(map) = files.iter().find(|file| file.path == "ARCHITECTURE.md") else {
        return vec!["ARCHITECTURE.md: missing".into()];
    };
    let mapped: BTreeSet<&str> = map.text.lines().filter_map(folder_of_row).collect();
    let existing: BTreeSet<&str> = files
        .iter()
        .filter_map(|file| file.path.split_once('/'))
        .map(|(folder, _)| folder)
        .filter(|folder| !folder.starts_with('.'))
        .collect();
    let missing = existing.difference(&mapped).map(|folder| {
        format!("ARCHITECTURE.md: the folder map lacks `{folder}/`; add a row that says what it is")
    });
    let extra = mapped.difference(&existing).map(|folder| {
        format!("ARCHITECTURE.md: the folder map has `{folder}/`, which does not exist")
    });
    missing.chain(extra).collect()
}

/// The top-level folder that a table row is about.
fn folder_of_row(line: &str) -> Option<&str> {
    let name = line.strip_prefix("| `")?.split_once("/` |")?.0;
    (!name.contains('/')).then_some(name)
}

#[cfg(test)]
mod tests {
    use crate::checkout::file;

    #[test]
    fn the_map_must_match_in_both_directions() {
        let map =
            "| folder | is |\n|---|---|\n| `robot/` | x |\n| `gone/` | y |\n| `robot/src/` | z |\n";
        let files = [
            file("ARCHITECTURE.md", map),
            file("robot/src/lib.rs", ""),
            file("planner/src/lib.rs", ""),
            file(".ci/run", ""),
            file("README.md", ""),
        ];
        let found = super::violations(&files);
        assert_eq!(found.len(), 2, "{found:?}");
        assert!(found[0].contains("lacks `planner/`"));
        assert!(found[1].contains("`gone/`, which does not exist"));
    }

    #[test]
    fn a_missing_map_is_a_violation() {
        assert_eq!(super::violations(&[]).len(), 1);
    }
}
