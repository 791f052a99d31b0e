//! Files: the one reader, with a bound for every kind, and the one writer, which never leaves half a file and never
//! writes over what the run reads.
//!
//! [`read`] and [`read_text`] give the content of a file; [`Output`] is a place to write to, checked before a long run;
//! [`Lines`] and [`Series`] are files that grow during a run.
//! Errors name the file and what to do.

mod identity;
mod read;
mod series;
mod write;

pub use read::{Named, read, read_by, read_text, text};
pub use series::{Lines, Rotation, RotationArgs, Series};
pub use write::{Output, cannot_write, make_folder, save, write, write_pair, write_secret};

use crate::kind::Kind;
use miette::Diagnostic;
use std::ffi::OsString;
use std::io;
use std::path::{Path, PathBuf};
use thiserror::Error;

/// A file that could not be read or written.
#[derive(Debug, Error, Diagnostic)]
pub enum FileError {
    /// Missing file.
    #[error("there is no {kind} at {}", path.display())]
    Missing {
        /// Expected kind.
        kind: Kind,
        /// Path that was tried.
        path: PathBuf,
        #[help]
        help: String,
    },
    /// The operating system refused.
    #[error("cannot {action} {}: {reason}", path.display())]
    Io {
        action: &'static str,
        path: PathBuf,
        /// Error of the operating system. Not a `source`, which reports would print once more.
        reason: io::Error,
    },
    /// The file is not text.
    #[error("{} is not a {kind}: it is not UTF-8 text", path.display())]
    NotText {
        /// Expected kind.
        kind: Kind,
        path: PathBuf,
    },
    /// The file is larger than any of its kind.
    #[error(
        "{} has {} bytes; a {kind} has at most {}",
        path.display(),
        bytes.map_or_else(|| format!("more than {}", kind.max_bytes()), |bytes| bytes.to_string()),
        kind.max_bytes()
    )]
    #[diagnostic(help("is this the right file?"))]
    TooLarge {
        /// Expected kind.
        kind: Kind,
        path: PathBuf,
        /// Size of the file, if it has one.
        bytes: Option<u64>,
    },
    /// A device, a pipe or a folder, where only a file makes sense.
    #[error("cannot read {}: it is {found}, not a file with a {kind}", path.display())]
    NotAFile {
        /// Expected kind.
        kind: Kind,
        /// Path that was tried.
        path: PathBuf,
        found: &'static str,
    },
    /// A pipe or device that sends nothing.
    #[error("cannot read {}: nothing came from it for {seconds} s", path.display())]
    #[diagnostic(help("a pipe needs a program that writes into it"))]
    Silent {
        path: PathBuf,
        /// Time without data, s.
        seconds: u64,
    },
    /// The output is a file that the run reads.
    #[error("cannot write {}: it is {}, a {kind} that this run reads", output.display(), input.display())]
    #[diagnostic(help("write to a file of another name"))]
    OverInput {
        output: PathBuf,
        /// The same file, as it was read.
        input: PathBuf,
        kind: Kind,
    },
    /// The output is a file such as people write.
    #[error(
        "cannot write {}: it is there already, and by its name it is no result of this command",
        output.display()
    )]
    #[diagnostic(help("write to a file of another name, or remove this one first"))]
    OverSource { output: PathBuf },
    /// The output is a key.
    #[error("cannot write {}: it is a key, and a key is never overwritten", output.display())]
    #[diagnostic(help(
        "write to a file of another name; or remove this one, if no robot has its key any more"
    ))]
    OverKey { output: PathBuf },
    /// Two outputs are one file.
    #[error("cannot write {} and {}: they are the same file", first.display(), second.display())]
    #[diagnostic(help("give each its own file"))]
    SameOutput { first: PathBuf, second: PathBuf },
    /// The folder of an output is not there.
    #[error("cannot write {}: there is no folder {}", path.display(), folder.display())]
    #[diagnostic(help("make it first: mkdir -p {}", folder.display()))]
    NoFolder { path: PathBuf, folder: PathBuf },
    /// Something else is where the folder of an output should be.
    #[error("cannot write into {}: it is no folder", path.display())]
    NotAFolder {
        /// Path that is no folder.
        path: PathBuf,
    },
    /// The ending of an output's name stands for another format.
    #[error("cannot write {what} as {}: {what} can be written as {}", path.display(), dotted(endings))]
    Ending {
        /// Kind of result to be written.
        what: &'static str,
        path: PathBuf,
        /// Endings of the formats that there are.
        endings: &'static [&'static str],
        /// Advice on the requested format.
        #[help]
        help: Option<&'static str>,
    },
}

/// Endings of names as they are listed.
fn dotted(endings: &[&str]) -> String {
    let dotted: Vec<_> = endings.iter().map(|ending| format!(".{ending}")).collect();
    match dotted.split_last() {
        Some((last, others)) if !others.is_empty() => format!("{} or {last}", others.join(", ")),
        _ => dotted.concat(),
    }
}

/// The ending of an output's name, which must be one of a format that `what` can be written in, or none.
///
/// # Errors
/// It stands for another format.
pub fn ending(
    path: &Path,
    what: &'static str,
    endings: &'static [&'static str],
) -> Result<Option<&'static str>, FileError> {
    let Some(given) = path.extension() else { return Ok(None) };
    let given = given.to_string_lossy().to_lowercase();
    let found = endings.iter().copied().find(|ending| *ending == given);
    let help = match &*given {
        "pdf" if endings.contains(&"svg") => {
            Some("write .svg; `rsvg-convert -f pdf`, Inkscape or a browser makes a PDF of it")
        }
        "webm" | "avi" | "mov" if endings.contains(&"mp4") => {
            Some("write .mp4, which ffmpeg turns into others")
        }
        "gif" | "mp4" if what == "a figure" => Some("add --animate: figures do not move"),
        "mjcf" if endings.contains(&"xml") => Some("models for MuJoCo end in .xml"),
        "sdf" if endings.contains(&"urdf") => {
            Some("write .urdf; Gazebo reads it, and `gz sdf -p FILE.urdf` makes an SDF of it")
        }
        "stl" | "obj" | "dae" if endings.contains(&"urdf") => {
            Some("robots are written with simple solids, not with meshes")
        }
        "xlsx" | "ods" if endings.contains(&"csv") => Some("write .csv, which spreadsheets open"),
        _ => None,
    };
    match found {
        Some(found) => Ok(Some(found)),
        None => Err(FileError::Ending { what, path: path.to_owned(), endings, help }),
    }
}

/// The name of a file that belongs to another, as `run.2.log` to `run.log`.
pub fn numbered(path: &Path, number: u32) -> PathBuf {
    let mut ending = OsString::from(number.to_string());
    if let Some(last) = path.extension() {
        ending.push(".");
        ending.push(last);
    }
    path.with_extension(ending)
}

/// A name as a file name: every character but letters, digits, `-`, `_` and `.` becomes `_`, and no dot begins it.
pub fn file_name(name: &str) -> String {
    let safe = |c: char| if c.is_alphanumeric() || "-_.".contains(c) { c } else { '_' };
    name.chars().map(safe).collect::<String>().trim_start_matches('.').to_owned()
}

/// The folder that a file lies in.
pub fn folder(path: &Path) -> &Path {
    path.parent().filter(|folder| *folder != Path::new("")).unwrap_or(Path::new("."))
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
