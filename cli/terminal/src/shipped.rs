//! Shipped robots and motions, read in the same way as files.

use rollwalk_shipped::FILES;
use std::path::{Component, Path, PathBuf};
use std::{fs, io};

/// Library file of the demo.
pub const DEMO_LIBRARY: &str = "motions/agilebot_library.toml";

/// Text of a shipped file.
pub fn text(path: &Path) -> Option<&'static str> {
    rollwalk_shipped::text(path.to_str()?)
}

/// Text of the shipped file at the given path; `None` if something exists there on the disk.
pub fn instead_of(path: &Path) -> Option<&'static str> {
    if is_missing(path) { text(path) } else { None }
}

/// Text of the shipped file for a path that another file contains as `named`; `path` is this path relative to that file.
/// `None` if something exists at `path` on the disk.
pub fn instead_of_named(path: &Path, named: &str) -> Option<&'static str> {
    if is_missing(path) { text(path).or_else(|| text(&without_way_up(named))) } else { None }
}

fn is_missing(path: &Path) -> bool {
    // A dangling link exists: the user means its target.
    fs::symlink_metadata(path).is_err_and(|error| error.kind() == io::ErrorKind::NotFound)
}

/// Path without leading `..`: shipped motions name `../robots/agilebot.toml`, and so do their copies in other folders.
pub fn without_way_up(named: &str) -> PathBuf {
    let steps = Path::new(named).components();
    steps.skip_while(|step| matches!(step, Component::ParentDir | Component::CurDir)).collect()
}

/// Names and texts of the shipped files in a folder.
pub fn files_in(folder: &Path) -> impl Iterator<Item = (&'static str, &'static str)> {
    let files = FILES.iter().map(|&(path, text)| (Path::new(path), text));
    let there = files.filter(move |(path, _)| path.parent() == Some(folder));
    there.filter_map(|(path, text)| Some((path.file_name()?.to_str()?, text)))
}

/// Shipped library file for the robot of a robot file.
pub fn library_of(robot: &Path) -> Option<&'static Path> {
    let names = format!("/{}.toml\"", robot.file_stem()?.to_str()?);
    let libraries = FILES.iter().filter(|(path, _)| path.ends_with("_library.toml"));
    let is_its =
        |text: &str| text.lines().any(|line| line.starts_with("robot = ") && line.contains(&names));
    let its = libraries.filter(|(_, text)| is_its(text)).map(|(path, _)| *path);
    // Libraries with more motions have longer names.
    its.min_by_key(|path| path.len()).map(Path::new)
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

    #[test]
    fn robots_have_their_libraries() {
        let library = |robot: &str| super::library_of(Path::new(robot)).and_then(Path::to_str);
        assert_eq!(library("robots/pup.toml"), Some("motions/pup_library.toml"));
        assert_eq!(library("agilebot"), Some("motions/agilebot_library.toml"));
        assert_eq!(library("robots/anymal_wheels.toml"), Some("motions/anymal_library.toml"));
        assert_eq!(library("robots/car.toml"), None);
    }
}
