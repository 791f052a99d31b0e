//! Record of the steps that have passed at a commit, so that a command of hours can be interrupted and continued.

use crate::shell;
use std::fs;
use std::path::PathBuf;

/// Steps of a command that have passed at the current commit, with their seconds.
pub struct Record {
    /// Folder with one file a step, named after the commit; `None` if the working tree differs from its commit.
    folder: Option<PathBuf>,
}

impl Record {
    /// Opens the record of `cargo xtask COMMAND` at the current commit.
    pub fn open(command: &str) -> Self {
        let folder = commit().map(|commit| {
            shell::target_folder().join("steps").join(format!("{command}-passed")).join(commit)
        });
        Self { folder }
    }

    /// Returns the seconds of a step that has passed.
    pub fn passed(&self, step: &str) -> Option<f64> {
        fs::read_to_string(self.folder.as_ref()?.join(step)).ok()?.trim().parse().ok()
    }

    /// Adds a step that has passed, unless files or the commit have changed since the record was opened. Without a writable
    /// target folder, the step is repeated next time.
    pub fn add(&self, step: &str, seconds: f64) {
        let is_same = |folder: &PathBuf| commit().is_some_and(|commit| folder.ends_with(commit));
        if let Some(folder) = self.folder.as_ref().filter(|folder| is_same(folder)) {
            let written = fs::create_dir_all(folder)
                .and_then(|()| fs::write(folder.join(step), format!("{seconds:.1}\n")));
            if let Err(error) = written {
                eprintln!("cannot record the step in {}: {error}", folder.display());
            }
        }
    }
}

/// Returns the hash of the current commit; `None` if the working tree has other files, or without git.
fn commit() -> Option<String> {
    let git = |args: &[&str]| shell::output(&mut shell::command("git", args)).ok();
    let is_clean = git(&["status", "--porcelain"])?.trim().is_empty();
    is_clean.then(|| git(&["rev-parse", "HEAD"])).flatten().map(|hash| hash.trim().to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_has_passed_at_this_commit_is_known_to_the_next_run() {
        let all = shell::target_folder().join("steps").join("record-of-the-test");
        let _ = fs::remove_dir_all(&all);
        let record = |commit: &str| Record { folder: Some(all.join(commit)) };
        // A working tree with other files has no commit, and records nothing.
        let now = commit();
        let here = record(now.as_deref().unwrap_or("none"));
        here.add("one", 12.34);
        assert_eq!(here.passed("one"), now.map(|_| 12.3));
        assert_eq!(here.passed("two"), None);
        let other = record("0123456789");
        other.add("one", 12.34);
        assert_eq!(other.passed("one"), None);
        let none = Record { folder: None };
        none.add("one", 1.0);
        assert_eq!(none.passed("one"), None);
        let _ = fs::remove_dir_all(all);
    }
}
