//! Files that this run has read, under any of their names: none of them may be an output.

use super::FileError;
use crate::kind::Kind;
use same_file::Handle;
use std::fs::File;
use std::path::{Path, PathBuf};
use std::sync::{Mutex, MutexGuard, PoisonError};

/// An input. Its handle keeps the file open, so that no other file takes its place.
struct Input {
    handle: Handle,
    path: PathBuf,
    kind: Kind,
}

/// Inputs of this process. They are global, because readers are all over the program and outputs are checked against all inputs.
static INPUTS: Mutex<Vec<Input>> = Mutex::new(Vec::new());

fn inputs() -> MutexGuard<'static, Vec<Input>> {
    INPUTS.lock().unwrap_or_else(PoisonError::into_inner)
}

/// The shipped files that were read, by the paths that they stand in for.
static STOOD_IN: Mutex<Vec<(PathBuf, Kind)>> = Mutex::new(Vec::new());

fn stood_in() -> MutexGuard<'static, Vec<(PathBuf, Kind)>> {
    STOOD_IN.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Notes that a shipped file is read in place of one that is not there: an output there would take its place in the next run.
pub fn note_shipped(path: &Path, kind: Kind) {
    stood_in().push((path.to_owned(), kind));
}

/// Notes that a regular file is read.
pub fn note_input(file: File, path: &Path, kind: Kind) {
    // The cache of names is ours, and is brought up to date.
    if kind == Kind::Names {
        return;
    }
    // A file without identity cannot be compared.
    let Ok(handle) = Handle::from_file(file) else { return };
    let mut inputs = inputs();
    if inputs.iter().all(|input| input.handle != handle) {
        inputs.push(Input { handle, path: path.to_owned(), kind });
    }
}

/// Refuses an output that is an input.
///
/// # Errors
/// It is, under this or another name.
pub fn check_output(output: &Path) -> Result<(), FileError> {
    // What is not there yet was not read, unless a shipped file stood in for it.
    let Ok(handle) = Handle::from_path(output) else {
        let absolute = |path: &Path| std::path::absolute(path).ok();
        return match stood_in().iter().find(|(path, _)| absolute(path) == absolute(output)) {
            Some((input, kind)) => Err(FileError::OverInput {
                output: output.to_owned(),
                input: input.clone(),
                kind: *kind,
            }),
            None => Ok(()),
        };
    };
    match inputs().iter().find(|input| input.handle == handle) {
        None => Ok(()),
        Some(Input { path, kind, .. }) => Err(FileError::OverInput {
            output: output.to_owned(),
            input: path.clone(),
            kind: *kind,
        }),
    }
}
