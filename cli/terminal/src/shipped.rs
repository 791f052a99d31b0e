//! Shipped robots and motions, read in the same way as files.

use rollwalk_shipped::FILES;
use std::ffi::OsStr;
use std::path::Path;
use std::{fs, io};

/// Library file of the demo.
pub const DEMO_LIBRARY: &str = "motions/agilebot_library.toml";

/// Text of a shipped file.
pub fn text(path: &Path) -> Option<&'static str> {
    rollwalk_shipped::text(path.to_str()?)
}

/// Text of the shipped file at the given path; `None` if something exists there on the disk.
pub fn instead_of(path: &Path) -> Option<&'static str> {
    // A dangling link exists: the user means its target.
    let missing = fs::symlink_metadata(path).is_err_and(|e| e.kind() == io::ErrorKind::NotFound);
    if missing { text(path) } else { None }
}

/// Names of the shipped files in a folder, with the given extension.
pub fn names_in(folder: &Path, extension: Option<&OsStr>) -> impl Iterator<Item = &'static str> {
    let files = FILES.iter().map(|(path, _)| Path::new(path));
    let there = files.filter(move |path| path.parent() == Some(folder));
    there
        .filter(move |path| path.extension() == extension)
        .filter_map(|path| path.file_name()?.to_str())
}

/// The shipped robot files.
pub fn robots() -> impl Iterator<Item = &'static Path> {
    FILES.iter().map(|(path, _)| Path::new(path)).filter(|path| path.starts_with("robots"))
}

#[cfg(test)]
mod tests {
    use crate::inputs::Source;
    use std::path::Path;

    #[test]
    fn the_demo_finds_everything_it_names_in_the_binary() {
        let library = Source::Shipped.library(Path::new(super::DEMO_LIBRARY)).unwrap();
        assert_eq!(library.motions.len(), library.file.motions.len());
        assert!(super::robots().count() >= 3);
    }
}
