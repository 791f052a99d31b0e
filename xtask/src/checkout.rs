//! Text files of the checkout.

use ignore::WalkBuilder;
use std::fs;
use std::path::Path;

/// Text file of the checkout.
pub struct TextFile {
    /// Path from the workspace root, with `/` between folders.
    pub path: String,
    pub text: String,
}

/// Reads all text files that git does not ignore, sorted by path. Also works without git.
///
/// # Errors
/// Returns an error if the checkout cannot be listed.
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
        // Files that are not UTF-8 are images or golden bytes, to which no rule applies.
        let Ok(text) = fs::read_to_string(entry.path()) else { continue };
        let path = entry.path().strip_prefix(root).map_err(|error| error.to_string())?;
        let path = path.to_string_lossy().replace('\\', "/");
        files.push(TextFile { path, text });
    }
    Ok(files)
}

/// Creates a file for tests.
#[cfg(test)]
pub fn file(path: &str, text: &str) -> TextFile {
    TextFile { path: path.into(), text: text.into() }
}
