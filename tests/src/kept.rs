//! Cache of results that several tests need as an input. Each is planned once for each program and each input, and copied to
//! the desks.
//!
//! A separate test checks that the same input gives the same bytes. Tests of the planner itself do not use the cache.

use crate::Desk;
use std::collections::hash_map::DefaultHasher;
use std::fs::{self, File};
use std::hash::{Hash, Hasher};
use std::path::{Path, PathBuf};
use std::sync::OnceLock;

impl Desk {
    /// Creates a file by a command that ends in `-o NAME`, or copies the result of an earlier run. Results are shared by the
    /// same command of the same program with the same TOML files. Plans and libraries are made without simulation.
    ///
    /// # Panics
    /// Panics if the command fails.
    #[track_caller]
    pub fn make(&self, args: &[&str]) {
        let [.., "-o", name] = args else { panic!("{args:?} does not end in -o NAME") };
        let kept = self.folder_of_results().join(format!("{:016x}", self.key(args)));
        let lock = File::create(kept.with_extension("lock")).expect("a lock file");
        lock.lock().expect("a lock");
        if !kept.exists() {
            let plays = matches!(args, ["plan", ..] | ["library", "build", ..]);
            let unplayed: &[&str] = if plays { &["--no-simulation"] } else { &[] };
            self.run(&[args, unplayed].concat()).succeeds();
            let part = kept.with_extension("part");
            fs::copy(self.path(name), &part).expect("a result");
            // An interrupted run leaves no partial result.
            fs::rename(part, kept).expect("a result");
        } else {
            fs::copy(kept, self.path(name)).expect("a kept result");
        }
    }

    /// Returns the folder with the results of this build of the program; results of other builds are removed.
    fn folder_of_results(&self) -> PathBuf {
        static FOLDER: OnceLock<PathBuf> = OnceLock::new();
        let make = || {
            let all = self.binary.with_extension("results");
            let program = fs::read(&self.binary).expect("the program");
            let folder = all.join(format!("{:016x}", hash(&program)));
            if !folder.exists() {
                let _ = fs::remove_dir_all(&all);
                fs::create_dir_all(&folder).expect("a folder beside the program");
            }
            folder
        };
        FOLDER.get_or_init(make).clone()
    }

    /// Hash of the inputs of a command: its arguments and the TOML files of the desk.
    fn key(&self, args: &[&str]) -> u64 {
        let mut files = Vec::new();
        find_toml(&self.path(""), &mut files);
        files.sort();
        let contents: Vec<_> = files.iter().map(|file| fs::read(file).expect("a file")).collect();
        let names: Vec<_> = files.iter().map(|file| file.strip_prefix(self.path(""))).collect();
        hash(&(args, names.into_iter().map(Result::ok).collect::<Vec<_>>(), contents))
    }
}

fn hash(value: &impl Hash) -> u64 {
    let mut hasher = DefaultHasher::new();
    value.hash(&mut hasher);
    hasher.finish()
}

fn find_toml(folder: &Path, into: &mut Vec<PathBuf>) {
    for entry in fs::read_dir(folder).expect("a folder") {
        let path = entry.expect("an entry").path();
        if path.is_dir() {
            find_toml(&path, into);
        } else if path.extension().is_some_and(|ending| ending == "toml") {
            into.push(path);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn another_file_or_argument_is_another_result() {
        let desk = Desk::new("rollwalk");
        desk.write("robots/a.toml", "a");
        desk.write("a.json", "a");
        let key = desk.key(&["plan", "-o", "x"]);
        desk.write("a.json", "b");
        assert_eq!(desk.key(&["plan", "-o", "x"]), key);
        assert_ne!(desk.key(&["plan", "-v", "-o", "x"]), key);
        desk.write("robots/a.toml", "b");
        assert_ne!(desk.key(&["plan", "-o", "x"]), key);
    }
}
