//! The shipped robots and motions, read as files are.

use rollwalk_shipped::FILES;
use std::path::Path;

/// The library file that the demo plays.
pub const DEMO_LIBRARY: &str = "motions/agilebot_library.toml";

/// The text of a shipped file.
pub fn text(path: &Path) -> Option<&'static str> {
    rollwalk_shipped::text(path.to_str()?)
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
