//! Reading files with a size limit for each kind, and writing them without leaving half a file or overwriting an input.
//!
//! [`read`] and [`read_text`] return the content of a file. [`Output`] is a destination, checked before a long run. [`Lines`]
//! and [`Series`] are files that grow during a run. Errors name the file and the remedy.

mod identity;
mod keys;
mod missing;
mod read;
mod series;
mod write;

pub use keys::{write_pair, write_secret};
pub use read::{PathSource, check, read, read_by, read_text, text};
pub use series::{Lines, Rotation, RotationArgs, Series};
pub use write::{Output, cannot_write, make_folder, save, write};

use crate::kind::Kind;
use miette::Diagnostic;
use std::ffi::OsString;
use std::io;
use std::path::{Path, PathBuf};
use thiserror::Error;

/// File that cannot be read or written.
#[derive(Debug, Error, Diagnostic)]
pub enum FileError {
    /// Missing file.
    #[error("there is no {kind} at {}{not_shipped}", path.display())]
    Missing {
        /// Expected kind.
        kind: Kind,
        /// Path that was tried.
        path: PathBuf,
        /// Second place that was searched, as the end of the message; empty if there is none.
        not_shipped: String,
        #[help]
        help: String,
    },
    /// The operating system refused.
    #[error("cannot {action} {}: {reason}", path.display())]
    Io {
        action: &'static str,
        path: PathBuf,
        /// Error of the operating system. Not a `source`, because reports would then print the text twice.
        reason: io::Error,
    },
    /// The file is not UTF-8 text.
    #[error("{} is not a {kind}: it is not UTF-8 text", path.display())]
    NotText {
        /// Expected kind.
        kind: Kind,
        path: PathBuf,
    },
    /// The file exceeds the size limit of its kind.
    #[error(
        "{} has {} bytes; a {kind} has at most {}",
        path.display(),
        bytes.map_or_else(|| format!("more than {}", kind.max_bytes()), |bytes| bytes.to_string()),
        kind.max_bytes()
    )]
    #[diagnostic(help("check the path: this file is probably not the intended one"))]
    TooLarge {
        /// Expected kind.
        kind: Kind,
        path: PathBuf,
        /// Size of the file, bytes; `None` for a pipe or device.
        bytes: Option<u64>,
    },
    /// The path is a device, a pipe or a folder, but only a regular file is accepted.
    #[error("cannot read {}: it is {found}, not a file with a {kind}", path.display())]
    NotAFile {
        /// Expected kind.
        kind: Kind,
        /// Path that was tried.
        path: PathBuf,
        found: &'static str,
        /// Files to give instead of a folder.
        #[help]
        help: Option<String>,
    },
    /// A pipe or device sent nothing before the timeout.
    #[error("cannot read {}: no data arrived for {seconds} s", path.display())]
    #[diagnostic(help("start a program that writes into the pipe"))]
    Silent {
        path: PathBuf,
        /// Timeout, s.
        seconds: u64,
    },
    /// The output is a file that the run reads.
    #[error("cannot write {}: it is {}, a {kind} that this command reads", output.display(), input.display())]
    #[diagnostic(help("give another file name for the result"))]
    OverInput {
        output: PathBuf,
        /// Path under which the file was read.
        input: PathBuf,
        kind: Kind,
    },
    /// The output exists and has the extension of a file that users write.
    #[error(
        "cannot write {}: it exists, and this command writes files with another extension",
        output.display()
    )]
    #[diagnostic(help("give another file name, or remove the existing file first"))]
    OverSource { output: PathBuf },
    /// The output exists and is a key.
    #[error("cannot write {}: the file contains a key, and keys are never overwritten", output.display())]
    #[diagnostic(help(
        "give another file name, or remove the existing key if no robot uses it any more"
    ))]
    OverKey { output: PathBuf },
    /// Two outputs are the same file.
    #[error("cannot write {} and {}: they are the same file", first.display(), second.display())]
    #[diagnostic(help("give two different file names"))]
    SameOutput { first: PathBuf, second: PathBuf },
    /// The folder of an output does not exist.
    #[error("cannot write {}: there is no folder {}", path.display(), folder.display())]
    #[diagnostic(help("make the folder first: mkdir -p {}", folder.display()))]
    NoFolder { path: PathBuf, folder: PathBuf },
    /// The parent path of an output exists, but is not a folder.
    #[error("cannot write into {}: it is not a folder", path.display())]
    NotAFolder {
        /// Path that is not a folder.
        path: PathBuf,
    },
    /// The extension of the output stands for a format that the command cannot write.
    #[error("cannot write {what} as {}: {what} can be written as {}", path.display(), dotted(endings))]
    Ending {
        /// Kind of result to be written.
        what: &'static str,
        path: PathBuf,
        /// Extensions of the supported formats.
        endings: &'static [&'static str],
        /// Advice on the requested format.
        #[help]
        help: Option<&'static str>,
    },
}

/// Formats extensions for a message: `.a, .b or .c`.
fn dotted(endings: &[&str]) -> String {
    let dotted: Vec<_> = endings.iter().map(|ending| format!(".{ending}")).collect();
    match dotted.split_last() {
        Some((last, others)) if !others.is_empty() => format!("{} or {last}", others.join(", ")),
        _ => dotted.concat(),
    }
}

/// Returns the extension of an output, or `None` if the path has none.
///
/// # Errors
/// Returns an error if the extension is not in `endings`.
pub fn ending(
    path: &Path,
    what: &'static str,
    endings: &'static [&'static str],
) -> Result<Option<&'static str>, FileError> {
    let Some(given) = path.extension() else { return Ok(None) };
    let given = given.to_string_lossy().to_lowercase();
    let found = endings.iter().copied().find(|ending| *ending == given);
    let help = match &*given {
        "pdf" if endings.contains(&"svg") => Some(
            "write .svg, and convert it to PDF with `rsvg-convert -f pdf`, Inkscape or a browser",
        ),
        "webm" | "avi" | "mov" if endings.contains(&"mp4") => {
            Some("write .mp4, and convert it to other formats with ffmpeg")
        }
        "gif" | "mp4" if what == "a figure" => Some("add --animate to write an animation"),
        "mjcf" if endings.contains(&"xml") => Some("write .xml for MuJoCo"),
        "sdf" if endings.contains(&"urdf") => Some(
            "write .urdf: Gazebo reads URDF files, and `gz sdf -p FILE.urdf` converts them to SDF",
        ),
        "stl" | "obj" | "dae" if endings.contains(&"urdf") => {
            Some("write .urdf: robots are exported with simple solids, not with meshes")
        }
        "xlsx" | "ods" if endings.contains(&"csv") => Some("write .csv, which spreadsheets open"),
        _ => None,
    };
    match found {
        Some(found) => Ok(Some(found)),
        None => Err(FileError::Ending { what, path: path.to_owned(), endings, help }),
    }
}

/// Path of another file of a series: `run.2.log` for `run.log` and 2.
pub fn numbered(path: &Path, number: u32) -> PathBuf {
    let mut ending = OsString::from(number.to_string());
    if let Some(last) = path.extension() {
        ending.push(".");
        ending.push(last);
    }
    path.with_extension(ending)
}

/// Converts a name to a file name. Characters other than letters, digits, `-`, `_` and `.` become `_`; leading dots are
/// removed.
pub fn file_name(name: &str) -> String {
    let safe = |c: char| if c.is_alphanumeric() || "-_.".contains(c) { c } else { '_' };
    name.chars().map(safe).collect::<String>().trim_start_matches('.').to_owned()
}

/// Folder of a file, `.` for a bare file name.
pub fn folder(path: &Path) -> &Path {
    path.parent().filter(|folder| *folder != Path::new("")).unwrap_or(Path::new("."))
}

/// Names of the files in a folder.
#[cfg(test)]
fn names(folder: &Path) -> Vec<String> {
    let entries = std::fs::read_dir(folder).expect("a folder");
    entries.map(|entry| entry.unwrap().file_name().into_string().unwrap()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_become_plain_file_names() {
        assert_eq!(file_name("walk to turn_in_place"), "walk_to_turn_in_place");
        assert_eq!(file_name("../../etc/passwd"), "_.._etc_passwd");
    }

    #[test]
    fn endings_say_which_formats_there_are() {
        let ending = |name: &str| ending(Path::new(name), "a figure", &["svg"]);
        assert_eq!(ending("a/b.SVG").unwrap(), Some("svg"));
        assert_eq!(ending("a.b/c").unwrap(), None);
        let error = ending("x.pdf").unwrap_err();
        assert_eq!(
            error.to_string(),
            "cannot write a figure as x.pdf: a figure can be written as .svg"
        );
        assert!(error.help().unwrap().to_string().contains("rsvg-convert"));
        let robot = |name: &str| super::ending(Path::new(name), "a robot", &["urdf", "xml"]);
        assert!(robot("x.mjcf").unwrap_err().help().unwrap().to_string().contains(".xml"));
        let error = super::ending(Path::new("x.pdf"), "a table", &["csv"]).unwrap_err();
        assert!(error.help().is_none());
    }
}
