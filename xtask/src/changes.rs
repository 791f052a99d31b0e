//! Files that a working tree has changed against main, and whether they concern a step.

use crate::shell;
use std::path::{Path, PathBuf};

/// Revision that a working tree is compared with: where it left the main branch of the repository it was cloned from, else its
/// own `main`; else only what is not committed yet counts.
fn base() -> String {
    let left = |branch| git(&["merge-base", "HEAD", branch]).ok();
    left("origin/main").or_else(|| left("main")).unwrap_or_else(|| "HEAD".into())
}

/// Files that differ from a revision ([`base`] by default), and those that git does not know yet.
///
/// # Errors
/// Git's: this is no clone, or there is no such revision.
pub fn files(since: Option<&str>) -> Result<Vec<PathBuf>, String> {
    let base = since.map_or_else(base, str::to_owned);
    let changed = git(&["diff", "--name-only", "--no-renames", base.trim()])?;
    let new = git(&["ls-files", "--others", "--exclude-standard"])?;
    let root = shell::workspace_root();
    Ok(changed.lines().chain(new.lines()).map(|file| root.join(file)).collect())
}

/// True if one of the files is in one of `paths`: folders or files, relative to the workspace root. `**/NAME` is a file of this
/// name in any folder.
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
