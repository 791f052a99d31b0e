//! Files of a working tree that differ from main, and the steps that they affect.

use crate::shell;
use std::path::{Path, PathBuf};

/// Revision with which a working tree is compared: the merge base with the main branch of its origin, or else with its own
/// `main`; or else `HEAD`, so that only uncommitted changes count.
fn base() -> String {
    let left = |branch| git(&["merge-base", "HEAD", branch]).ok();
    left("origin/main").or_else(|| left("main")).unwrap_or_else(|| "HEAD".into())
}

/// Returns the files that differ from a revision ([`base`] by default), and those that git does not track yet.
///
/// # Errors
/// Returns git's error if this is not a clone, or if the revision does not exist.
pub fn files(since: Option<&str>) -> Result<Vec<PathBuf>, String> {
    let base = since.map_or_else(base, str::to_owned);
    let changed = git(&["diff", "--name-only", "--no-renames", base.trim()])?;
    let new = git(&["ls-files", "--others", "--exclude-standard"])?;
    let root = shell::workspace_root();
    Ok(changed.lines().chain(new.lines()).map(|file| root.join(file)).collect())
}

/// True if one of the files is in one of `paths`: folders or files, relative to the workspace root. `**/NAME` stands for files
/// of this name in any folder.
pub fn concern(files: &[PathBuf], paths: &[&str]) -> bool {
    let root = shell::workspace_root();
    let is_in = |file: &Path, path: &str| match path.strip_prefix("**/") {
        Some(name) => file.file_name().is_some_and(|file| file == name),
        None => file.starts_with(root.join(path)),
    };
    files.iter().any(|file| paths.iter().any(|path| is_in(file, path)))
}

fn git(args: &[&str]) -> Result<String, String> {
    shell::output(&mut shell::command("git", args))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_folder_is_concerned_by_its_files_and_by_no_others() {
        let files = ["studio/web/src/a.ts", "robot/Cargo.toml"];
        let files = files.map(|file| shell::workspace_root().join(file));
        for (paths, concerned) in [
            (&["studio/web", "cli"][..], true),
            (&["studio/we"], false),
            (&["robot/Cargo.toml"], true),
            (&["**/Cargo.toml"], true),
            (&["**/a.rs", "Cargo.toml"], false),
        ] {
            assert_eq!(concern(&files, paths), concerned, "{paths:?}");
        }
    }
}
