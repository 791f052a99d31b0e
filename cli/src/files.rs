//! Reading with errors that help, and writing that never leaves half a file.

use miette::{Diagnostic, Report};
use std::fs::{self, File};
use std::io::{self, BufWriter, Write};
use std::path::{Path, PathBuf};
use thiserror::Error;

/// A file that could not be read or written.
#[derive(Debug, Error, Diagnostic)]
pub enum FileError {
    /// Nothing lies at the path.
    #[error("there is no {kind} at {}", path.display())]
    Missing {
        /// What was looked for, such as "motion file (TOML)".
        kind: &'static str,
        /// Where it was looked for.
        path: PathBuf,
        /// What to type.
        #[help]
        help: String,
    },
    /// The operating system refused.
    #[error("cannot {action} {}: {reason}", path.display())]
    Io {
        /// "read" or "write".
        action: &'static str,
        /// The file.
        path: PathBuf,
        /// What the operating system said. Not a `source`, which reports would print once more.
        reason: io::Error,
    },
    /// The file is not text.
    #[error("{} is not a {kind}: it is not UTF-8 text", path.display())]
    NotText {
        /// What was looked for.
        kind: &'static str,
        /// The file.
        path: PathBuf,
    },
}

/// The bytes of a file of the named `kind`; `hint` says what to type when it is not there.
pub fn read(path: &Path, kind: &'static str, hint: &str) -> miette::Result<Vec<u8>> {
    fs::read(path).map_err(|reason| {
        let path = path.to_owned();
        let error = match reason.kind() {
            io::ErrorKind::NotFound => FileError::Missing { kind, help: help(&path, hint), path },
            _ => FileError::Io { action: "read", path, reason },
        };
        error.into()
    })
}

/// The text of a file of the named `kind`.
pub fn read_text(path: &Path, kind: &'static str, hint: &str) -> miette::Result<String> {
    String::from_utf8(read(path, kind, hint)?)
        .map_err(|_| FileError::NotText { kind, path: path.to_owned() }.into())
}

/// What to type, after the files of the same kind that lie beside the missing one.
fn help(path: &Path, hint: &str) -> String {
    let folder = folder(path);
    let mut beside: Vec<String> = fs::read_dir(folder)
        .into_iter()
        .flatten()
        .filter_map(|entry| Some(entry.ok()?.path()))
        .filter(|found| found.extension() == path.extension() && found.is_file())
        .filter_map(|found| Some(found.file_name()?.to_str()?.to_owned()))
        .collect();
    // The nearest name first: a slip in typing is the likeliest reason.
    let given = path.file_name().unwrap_or_default().to_string_lossy();
    let similarity = |name: &String| strsim::normalized_damerau_levenshtein(&given, name);
    beside.sort();
    beside.sort_by(|a, b| similarity(b).total_cmp(&similarity(a)));
    beside.truncate(8);
    if !folder.exists() {
        format!("the folder {} does not exist either; {hint}", folder.display())
    } else if beside.is_empty() {
        hint.to_owned()
    } else {
        format!("{} has {}; {hint}", folder.display(), beside.join(", "))
    }
}

/// The folder that a file lies in.
pub fn folder(path: &Path) -> &Path {
    path.parent().filter(|folder| *folder != Path::new("")).unwrap_or(Path::new("."))
}

/// Makes a folder if it is missing and makes sure that files can be written into it, so that a long
/// run does not end with results that have nowhere to go.
pub fn prepare(folder: &Path) -> miette::Result<()> {
    let attempt = || {
        fs::create_dir_all(folder)?;
        temporary_in(folder).map(drop)
    };
    attempt().map_err(|reason| {
        FileError::Io { action: "write into", path: folder.to_owned(), reason }.into()
    })
}

/// Creates a temporary file; its errors leave out the random name.
fn temporary_in(folder: &Path) -> io::Result<tempfile::NamedTempFile> {
    let made = tempfile::Builder::new().prefix(".rollwalk-").tempfile_in(folder);
    made.map_err(|error| error.kind().into())
}

/// Writes a file whole or not at all: into a temporary file beside it, then renamed over it, so that
/// an interrupted run leaves the earlier file as it was. Folders are made as needed.
pub fn write(path: &Path, content: &[u8]) -> miette::Result<()> {
    let folder = folder(path);
    let attempt = || -> io::Result<()> {
        fs::create_dir_all(folder)?;
        let mut temporary = temporary_in(folder)?;
        temporary.write_all(content)?;
        temporary.as_file().sync_all()?;
        share_like_a_new_file(temporary.as_file())?;
        temporary.persist(path).map_err(|error| error.error)?;
        Ok(())
    };
    attempt().map_err(|reason| cannot_write(path, reason))
}

/// Creates a file that grows during a run, and its folders. The caller must flush it at the end: dropping it ignores
/// errors of the last write.
pub fn create(path: &Path) -> miette::Result<BufWriter<File>> {
    let attempt = || -> io::Result<_> {
        fs::create_dir_all(folder(path))?;
        Ok(BufWriter::new(File::create(path)?))
    };
    attempt().map_err(|reason| cannot_write(path, reason))
}

/// Why a file cannot be written.
pub fn cannot_write(path: &Path, reason: io::Error) -> Report {
    FileError::Io { action: "write", path: path.to_owned(), reason }.into()
}

/// Temporary files are private to their user; results are to be readable by all.
#[cfg(unix)]
fn share_like_a_new_file(file: &File) -> io::Result<()> {
    use std::os::unix::fs::PermissionsExt;
    file.set_permissions(fs::Permissions::from_mode(0o644))
}

#[cfg(not(unix))]
fn share_like_a_new_file(_: &File) -> io::Result<()> {
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_missing_file_names_its_neighbours_and_what_to_type() {
        let folder = tempfile::tempdir().unwrap();
        fs::write(folder.path().join("walk.toml"), "").unwrap();
        fs::write(folder.path().join("walk.json"), "").unwrap();
        let path = folder.path().join("wlak.toml");
        let report = read(&path, "motion file", "type `rollwalk plan MOTION.toml`").unwrap_err();
        assert!(report.to_string().contains("wlak.toml"), "{report}");
        let help = report.help().unwrap().to_string();
        assert!(help.contains("walk.toml") && !help.contains("walk.json"), "{help}");
        assert!(help.contains("rollwalk plan MOTION.toml"), "{help}");
    }

    #[test]
    fn writing_makes_folders_and_replaces_whole_files() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a/b/plan.json");
        write(&path, b"a longer first text").unwrap();
        write(&path, b"second").unwrap();
        assert_eq!(fs::read(&path).unwrap(), b"second");
        let left: Vec<_> = fs::read_dir(path.parent().unwrap()).unwrap().collect();
        assert_eq!(left.len(), 1, "temporary files are gone");
    }

    #[test]
    fn a_folder_in_the_way_is_named_and_kept() {
        let folder = tempfile::tempdir().unwrap();
        let report = write(folder.path(), b"x").unwrap_err();
        assert!(report.to_string().contains("cannot write"), "{report}");
        assert!(folder.path().is_dir());
    }
}
