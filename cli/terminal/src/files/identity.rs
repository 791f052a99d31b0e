//! Which files this run has read, whatever the names that they were read by: none of them may be an output.

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

/// The inputs of this process: readers are all over the program, and an output must know all of them.
static INPUTS: Mutex<Vec<Input>> = Mutex::new(Vec::new());

fn inputs() -> MutexGuard<'static, Vec<Input>> {
    INPUTS.lock().unwrap_or_else(PoisonError::into_inner)
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
    // What is not there yet was not read.
    let Ok(handle) = Handle::from_path(output) else { return Ok(()) };
    match inputs().iter().find(|input| input.handle == handle) {
        None => Ok(()),
        Some(Input { path, kind, .. }) => Err(FileError::OverInput {
            output: output.to_owned(),
            input: path.clone(),
            kind: *kind,
        }),
    }
}
