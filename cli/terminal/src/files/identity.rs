//! Identities of the files that this run has read, so that no output overwrites an input, even under another name, and
//! detection of keys, which no output overwrites either.

use super::FileError;
use crate::kind::Kind;
use rollwalk_host::key_file;
use same_file::Handle;
use std::fs::File;
use std::io::Read;
use std::path::{Path, PathBuf};
use std::sync::{Mutex, MutexGuard, PoisonError};

/// Input file. The handle keeps the file open, so that no other file can get its identity.
struct Input {
    handle: Handle,
    path: PathBuf,
    kind: Kind,
}

/// Inputs of this process. The list is global, because inputs are read in all parts of the program.
static INPUTS: Mutex<Vec<Input>> = Mutex::new(Vec::new());

fn inputs() -> MutexGuard<'static, Vec<Input>> {
    INPUTS.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Paths at which no file exists and a shipped file was read instead.
static STOOD_IN: Mutex<Vec<(PathBuf, Kind)>> = Mutex::new(Vec::new());

fn shipped_stand_ins() -> MutexGuard<'static, Vec<(PathBuf, Kind)>> {
    STOOD_IN.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Records that a shipped file is read because no file exists at `path`. The next run would read an output at `path` instead.
pub fn record_shipped(path: &Path, kind: Kind) {
    shipped_stand_ins().push((path.to_owned(), kind));
}

/// Records that a regular file is read.
pub fn record_input(file: File, path: &Path, kind: Kind) {
    // The cache of names belongs to Rollwalk, and may be updated.
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

/// Refuses an output that is also an input.
///
/// # Errors
/// Returns an error if this run has read the file, under this or another name.
pub fn check_output(output: &Path) -> Result<(), FileError> {
    // A file that does not exist was not read, unless a shipped file replaced it.
    let Ok(handle) = Handle::from_path(output) else {
        let absolute = |path: &Path| std::path::absolute(path).ok();
        return match shipped_stand_ins().iter().find(|(path, _)| absolute(path) == absolute(output))
        {
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

/// Number of bytes at the start of a file that are searched for a key.
const KEY_START: u64 = 4096;

/// True if a file contains a link key or a key in PEM.
pub(super) fn is_key(path: &Path) -> bool {
    let mut start = Vec::new();
    let read = File::open(path).and_then(|file| file.take(KEY_START).read_to_end(&mut start));
    let text = String::from_utf8_lossy(&start);
    let is_pem =
        |line: &str| line.starts_with("-----BEGIN ") && line.trim_end().ends_with("KEY-----");
    read.is_ok() && (text.trim_start().starts_with(key_file::LINK) || text.lines().any(is_pem))
}
