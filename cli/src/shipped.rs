//! The robots and motions that ship with rollwalk, carried in the binary, so that `rollwalk demo`
//! runs in any folder.

use std::path::Path;

/// Declares the files, by their path in the checkout.
macro_rules! shipped {
    ($($path:literal),* $(,)?) => {
        const FILES: &[(&str, &str)] =
            &[$(($path, include_str!(concat!(env!("CARGO_MANIFEST_DIR"), "/../", $path)))),*];
    };
}

shipped!(
    "motions/agilebot_library.toml",
    "motions/drive_1m.toml",
    "motions/stand.toml",
    "motions/turn_in_place.toml",
    "motions/walk.toml",
    "robots/agilebot.toml",
    "robots/creature3.toml",
    "robots/swizzlebot.toml",
);

/// The library file that the demo plays.
pub const DEMO_LIBRARY: &str = "motions/agilebot_library.toml";

/// The text of a shipped file.
pub fn text(path: &Path) -> Option<&'static str> {
    FILES.iter().find(|(shipped, _)| Path::new(shipped) == path).map(|(_, text)| *text)
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
