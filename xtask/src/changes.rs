//! Files that a working tree has changed against main.

use crate::shell;
use std::path::PathBuf;

/// Revision that a working tree is compared with: where it left the main branch of the repository it was cloned from, else its own
/// `main`; else only what is not committed yet counts.
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

fn git(args: &[&str]) -> Result<String, String> {
    shell::output(&mut shell::command("git", args))
}
