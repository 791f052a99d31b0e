//! Check that each Rust file opens with `//!` and a description of the file.

use crate::checkout::TextFile;

/// Returns the files that open with anything else.
pub fn violations(files: &[TextFile]) -> Vec<String> {
    files
        .iter()
        .filter(|file| file.path.ends_with(".rs") && !file.text.starts_with("//! "))
        .map(|file| {
            format!("{}:1: begin the file with a `//!` line that describes its contents", file.path)
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use crate::checkout::file;

    #[test]
    fn only_undocumented_rust_files_are_named() {
        let files = [
            file("a/src/good.rs", "//! Says what it is.\n"),
            file("a/src/bad.rs", "use std::fs;\n//! Too late.\n"),
            file("a/src/empty.rs", ""),
            file("a/notes.md", "# Notes\n"),
        ];
        let found = super::violations(&files);
        assert_eq!(found.len(), 2, "{found:?}");
        assert!(found[0].starts_with("a/src/bad.rs:1") && found[1].starts_with("a/src/empty.rs:1"));
    }
}
