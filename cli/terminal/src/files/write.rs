//! Writing of output files. A regular file is replaced completely or not at all; devices and pipes are written to.

use super::{FileError, folder, identity};
use crate::output;
use miette::Report;
use same_file::Handle;
use std::fs::{self, File, OpenOptions, Permissions};
use std::io::{self, BufWriter, Write};
use std::path::{Path, PathBuf};
use std::sync::mpsc::sync_channel;
use std::thread;
use std::time::Duration;
use tempfile::NamedTempFile;

/// Maximum number of symbolic links followed to a file that does not exist yet, the same as on Linux.
const LINKS_MAX: usize = 40;

/// Destination of a result.
///
/// A regular file is replaced in one step after everything is written, so an interrupted run leaves the previous file intact.
/// The file keeps its permissions and the symbolic links to it. Devices and pipes are written to directly; `-` is standard
/// output. Results never replace files that users write (robots, motions, libraries, URDF).
#[derive(Debug)]
pub struct Output {
    /// Path as the user named it.
    path: PathBuf,
    place: Destination,
}

#[derive(Debug)]
enum Destination {
    /// Path of a regular file after symbolic links, and the file's permissions if it exists.
    File { path: PathBuf, permissions: Option<Permissions> },
    /// Device or pipe.
    Stream,
    /// Standard output, named `-` or by a device such as `/dev/stdout`.
    StandardOutput,
}

/// Extensions of files that users write.
const SOURCES: [&str; 3] = ["toml", "urdf", "xacro"];
/// Timeout of a pipe without a reader.
const PATIENCE: Duration = Duration::from_secs(30);

impl Output {
    /// Checks that a file can be written, so that a long run does not fail at its end.
    ///
    /// # Errors
    /// Returns an error for a folder, an input file of this run, a key file, an existing file that users write, or a path in a
    /// missing folder. Errors of the operating system are returned, too.
    pub fn at(path: &Path) -> Result<Self, FileError> {
        let output = Self::of_source(path)?;
        match &output.place {
            Destination::File { path: target, permissions: Some(_) }
                if target
                    .extension()
                    .is_some_and(|ending| SOURCES.iter().any(|s| ending == *s)) =>
            {
                Err(FileError::OverSource { output: path.to_owned() })
            }
            _ => Ok(output),
        }
    }

    /// Checks like [`at`](Self::at), but allows replacing a file that users write.
    ///
    /// # Errors
    /// Returns the errors of [`at`](Self::at), except the one about files that users write.
    pub fn of_source(path: &Path) -> Result<Self, FileError> {
        if path == Path::new("-") || is_standard_output(path) {
            return Ok(Self { path: path.to_owned(), place: Destination::StandardOutput });
        }
        let refused = |reason| FileError::Io { action: "write", path: path.to_owned(), reason };
        let place = match fs::metadata(path) {
            Ok(found) if found.is_file() => {
                identity::check_output(path)?;
                if identity::is_key(path) {
                    return Err(FileError::OverKey { output: path.to_owned() });
                }
                // Opens without truncation, to test whether the file is writable.
                OpenOptions::new().write(true).open(path).map_err(refused)?;
                let path = fs::canonicalize(path).map_err(refused)?;
                Destination::File { path, permissions: Some(found.permissions()) }
            }
            Ok(found) if found.is_dir() => return Err(refused(io::ErrorKind::IsADirectory.into())),
            Ok(_) => Destination::Stream,
            Err(error)
                if matches!(
                    error.kind(),
                    io::ErrorKind::NotFound | io::ErrorKind::NotADirectory
                ) =>
            {
                identity::check_output(path)?;
                Destination::File { path: end_of_links(path), permissions: None }
            }
            Err(reason) => return Err(refused(reason)),
        };
        if let Destination::File { path: target, .. } = &place {
            let folder = folder(target);
            check_folder(folder, path)?;
            temporary_in(folder).map_err(refused)?;
        }
        Ok(Self { path: path.to_owned(), place })
    }

    /// Path as the user named it.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Path of the file, with links followed. Devices and pipes return their own path.
    pub fn target(&self) -> &Path {
        match &self.place {
            Destination::File { path, .. } => path,
            Destination::Stream | Destination::StandardOutput => &self.path,
        }
    }

    /// Prints a comment on the result: to stdout, or to stderr if the result itself is on stdout.
    ///
    /// # Errors
    /// Returns an error if standard output is closed.
    pub fn comment(&self, text: &str) -> miette::Result<()> {
        match self.place {
            Destination::StandardOutput => {
                output::print_line(text);
                Ok(())
            }
            _ => output::print(text),
        }
    }

    /// Refuses a second output that is the same file.
    ///
    /// # Errors
    /// Returns an error if both outputs are the same file.
    pub fn apart_from(&self, other: &Self) -> Result<(), FileError> {
        let target = |output: &Self| match &output.place {
            Destination::File { path, .. } => {
                let folder = fs::canonicalize(folder(path)).ok()?;
                Some(folder.join(path.file_name()?))
            }
            Destination::Stream | Destination::StandardOutput => None,
        };
        match (target(self), target(other)) {
            (Some(one), Some(two)) if one == two => {
                Err(FileError::SameOutput { first: self.path.clone(), second: other.path.clone() })
            }
            _ => Ok(()),
        }
    }

    /// Writes the whole content.
    ///
    /// # Errors
    /// Returns an error if the operating system refuses.
    pub fn write(&self, content: &[u8]) -> miette::Result<()> {
        let attempt = || match &self.place {
            Destination::File { path, permissions } => replace(path, permissions.as_ref(), content),
            Destination::Stream => open_stream(&self.path, PATIENCE)?.write_all(content),
            Destination::StandardOutput => {
                let mut stdout = io::stdout().lock();
                let written = stdout.write_all(content).and_then(|()| stdout.flush());
                // The reader has closed the pipe, because it has read enough.
                written.or_else(|error| match error.kind() {
                    io::ErrorKind::BrokenPipe => Ok(()),
                    _ => Err(error),
                })
            }
        };
        attempt().map_err(|reason| cannot_write(&self.path, reason))
    }

    /// Creates or empties the file, for writing during a run.
    ///
    /// The caller must flush the writer at the end, because dropping it ignores errors of the final write.
    ///
    /// # Errors
    /// Returns an error if the operating system refuses.
    pub fn create(&self) -> miette::Result<BufWriter<File>> {
        let file = match &self.place {
            Destination::File { path, .. } => File::create(path),
            Destination::Stream => open_stream(&self.path, PATIENCE),
            Destination::StandardOutput => open_stream(Path::new("/dev/stdout"), PATIENCE),
        };
        Ok(BufWriter::new(file.map_err(|reason| cannot_write(&self.path, reason))?))
    }
}

/// Writes a file.
///
/// # Errors
/// Returns the errors of [`Output::at`] and [`Output::write`].
pub fn write(path: &Path, content: &[u8]) -> miette::Result<()> {
    Output::at(path)?.write(content)
}

/// Replaces a file that the user wants changed in place. Links and permissions are kept.
///
/// # Errors
/// Returns an error if the operating system refuses.
pub fn save(path: &Path, content: &[u8]) -> miette::Result<()> {
    let attempt = || {
        let target = fs::canonicalize(path)?;
        let permissions = fs::metadata(&target)?.permissions();
        replace(&target, Some(&permissions), content)
    };
    attempt().map_err(|reason| cannot_write(path, reason))
}

/// True if the path is standard output, such as `/dev/stdout`.
fn is_standard_output(path: &Path) -> bool {
    let same = |path| Some(Handle::from_path(path).ok()? == Handle::stdout().ok()?);
    // If output is redirected to a regular file, that file is to be replaced.
    path.starts_with("/dev") && path != Path::new("/dev/null") && same(path).unwrap_or(false)
}

/// Opens a device or a pipe, with a timeout for a pipe without a reader.
fn open_stream(path: &Path, patience: Duration) -> io::Result<File> {
    let (sender, opened) = sync_channel(1);
    let source = path.to_owned();
    // A thread that waits forever ends with the process.
    thread::spawn(move || sender.send(OpenOptions::new().write(true).open(source)));
    opened.recv_timeout(patience).unwrap_or_else(|_| {
        let seconds = patience.as_secs();
        Err(io::Error::other(format!("no program opened the pipe for reading within {seconds} s")))
    })
}

/// Creates a folder if it is missing, and checks that files can be written into it. The parent folder must exist.
///
/// # Errors
/// Returns an error if the folder cannot be created or written into, or if `path` is not a folder.
pub fn make_folder(path: &Path) -> Result<(), FileError> {
    check_folder(folder(path), path)?;
    let made = fs::create_dir(path);
    if path.exists() {
        check_folder(path, path)?;
    }
    let made = made.or_else(|error| if path.is_dir() { Ok(()) } else { Err(error) });
    made.and_then(|()| temporary_in(path).map(drop)).map_err(|reason| FileError::Io {
        action: "write into",
        path: path.to_owned(),
        reason,
    })
}

/// Refuses a folder that does not exist.
fn check_folder(folder: &Path, output: &Path) -> Result<(), FileError> {
    match fs::metadata(folder) {
        Ok(found) if found.is_dir() => Ok(()),
        Ok(_) => Err(FileError::NotAFolder { path: folder.to_owned() }),
        Err(_) => {
            let (path, folder) = (output.to_owned(), folder.to_owned());
            Err(FileError::NoFolder { path, folder })
        }
    }
}

/// Error for a file that cannot be written.
pub fn cannot_write(path: &Path, reason: io::Error) -> Report {
    FileError::Io { action: "write", path: path.to_owned(), reason }.into()
}

/// Follows symbolic links to their final target, which may not exist.
fn end_of_links(path: &Path) -> PathBuf {
    let mut path = path.to_owned();
    for _ in 0..LINKS_MAX {
        let Ok(next) = fs::read_link(&path) else { break };
        path = folder(&path).join(next);
    }
    path
}

/// Replaces a file by a temporary file that is written in the same folder.
fn replace(path: &Path, permissions: Option<&Permissions>, content: &[u8]) -> io::Result<()> {
    let mut temporary = temporary_in(folder(path))?;
    // Errors of `File` do not contain the random name.
    temporary.as_file_mut().write_all(content)?;
    if let Some(permissions) = permissions {
        keep_owner(path, temporary.as_file());
        temporary.as_file().set_permissions(permissions.clone())?;
    }
    temporary.as_file().sync_all()?;
    temporary.persist(path).map_err(|error| error.error)?;
    Ok(())
}

/// Creates a temporary file with the permissions of a new file. Errors omit its random name.
pub(super) fn temporary_in(folder: &Path) -> io::Result<NamedTempFile> {
    let mut builder = tempfile::Builder::new();
    builder.prefix(".rollwalk-");
    // Subtracts the umask. Temporary files are otherwise private to their user.
    #[cfg(unix)]
    builder.permissions(std::os::unix::fs::PermissionsExt::from_mode(0o666));
    builder.tempfile_in(folder).map_err(|error| error.kind().into())
}

/// Gives a new file the owner of the file that it replaces, if that is permitted.
#[cfg(unix)]
fn keep_owner(path: &Path, file: &File) {
    use std::os::unix::fs::{MetadataExt, fchown};
    if let Ok(earlier) = fs::metadata(path) {
        // Only root may give files away. A file that another user replaces becomes theirs.
        let _ = fchown(file, Some(earlier.uid()), Some(earlier.gid()));
    }
}

#[cfg(not(unix))]
fn keep_owner(_: &Path, _: &File) {}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::files::names;
    use crate::files::read;
    use crate::kind::Kind;
    use rollwalk_host::key_file;

    #[test]
    fn writing_replaces_whole_files_and_makes_no_folders() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("plan.json");
        write(&path, b"a longer first text").unwrap();
        write(&path, b"second").unwrap();
        assert_eq!(fs::read(&path).unwrap(), b"second");
        assert_eq!(names(folder.path()), ["plan.json"], "temporary files are gone");
        let error = write(&folder.path().join("a/b/plan.json"), b"x").unwrap_err().to_string();
        assert!(error.contains("there is no folder") && error.ends_with("a/b"), "{error}");
        assert_eq!(names(folder.path()), ["plan.json"]);
    }

    #[test]
    fn a_folder_is_made_alone_and_kept() {
        let folder = tempfile::tempdir().unwrap();
        let out = folder.path().join("out");
        make_folder(&out).unwrap();
        write(&out.join("x"), b"x").unwrap();
        make_folder(&out).unwrap();
        assert_eq!(names(&out), ["x"]);
        let error = make_folder(&folder.path().join("a/b")).unwrap_err().to_string();
        assert!(error.contains("there is no folder"), "{error}");
        let error = make_folder(&out.join("x")).unwrap_err().to_string();
        assert!(error.contains("cannot write into"), "{error}");
        let error = write(&out, b"x").unwrap_err().to_string();
        assert!(error.contains("cannot write") && error.contains("directory"), "{error}");
    }

    #[test]
    fn a_key_is_no_output() {
        let folder = tempfile::tempdir().unwrap();
        let pem =
            |kind: &str| format!("-----BEGIN {kind} KEY-----\nMC4=\n-----END {kind} KEY-----\n");
        for (number, text) in [
            key_file::text(&[7; 32]),
            format!("\n{}", key_file::text(&[7; 32])),
            pem("PRIVATE"),
            pem("PUBLIC"),
            pem("OPENSSH PRIVATE"),
            format!("made by openssl\r\n{}", pem("PRIVATE").replace('\n', "\r\n")),
        ]
        .iter()
        .enumerate()
        {
            let path = folder.path().join(format!("{number}.csv"));
            fs::write(&path, text).unwrap();
            for output in [Output::at(&path), Output::of_source(&path)] {
                let error = output.unwrap_err().to_string();
                assert!(
                    error
                        .ends_with(".csv: the file contains a key, and keys are never overwritten"),
                    "{error}"
                );
            }
            #[cfg(unix)]
            {
                let link = folder.path().join(format!("{number}.link"));
                std::os::unix::fs::symlink(&path, &link).unwrap();
                write(&link, b"x").unwrap_err();
            }
            assert_eq!(&fs::read_to_string(&path).unwrap(), text);
        }
        let other = folder.path().join("notes.csv");
        fs::write(&other, "about KEY-----\n").unwrap();
        write(&other, b"x").unwrap();
    }

    #[test]
    fn an_output_is_never_an_input() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        fs::write(at("robot.toml"), "name").unwrap();
        read(&at("robot.toml"), Kind::Robot).unwrap();
        fs::hard_link(at("robot.toml"), at("hard.json")).unwrap();
        let mut others = vec!["robot.toml", "hard.json", "sub/../robot.toml"];
        fs::create_dir(at("sub")).unwrap();
        #[cfg(unix)]
        {
            std::os::unix::fs::symlink("robot.toml", at("soft.json")).unwrap();
            others.push("soft.json");
        }
        for other in others {
            let error = Output::at(&at(other)).unwrap_err().to_string();
            assert!(error.contains(&format!("{other}: it is ")), "{error}");
            assert!(
                error.ends_with("robot.toml, a robot file (TOML) that this command reads"),
                "{error}"
            );
        }
        assert_eq!(fs::read(at("robot.toml")).unwrap(), b"name");
    }

    #[test]
    fn what_people_write_is_not_replaced_by_results() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("motion.toml");
        Output::at(&path).unwrap().write(b"new").unwrap();
        let error = Output::at(&path).unwrap_err().to_string();
        assert!(
            error.contains(
                "motion.toml: it exists, and this command writes files with another extension"
            ),
            "{error}"
        );
        Output::of_source(&path).unwrap().write(b"imported").unwrap();
        assert_eq!(fs::read(&path).unwrap(), b"imported");
    }

    #[test]
    fn two_outputs_are_two_files() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| Output::at(&folder.path().join(name)).unwrap();
        fs::create_dir(folder.path().join("sub")).unwrap();
        at("a").apart_from(&at("b")).unwrap();
        let error = at("a").apart_from(&at("sub/../a")).unwrap_err().to_string();
        assert!(error.ends_with("they are the same file"), "{error}");
    }

    #[cfg(unix)]
    mod unix {
        use super::*;
        use std::io::Read;
        use std::os::unix::fs::{FileTypeExt, PermissionsExt, symlink};
        use std::process::Command;
        use std::thread;

        #[test]
        fn a_link_stays_and_its_file_is_replaced() {
            let folder = tempfile::tempdir().unwrap();
            let at = |name: &str| folder.path().join(name);
            fs::create_dir(at("deep")).unwrap();
            fs::write(at("deep/real"), "old").unwrap();
            symlink("deep/real", at("link")).unwrap();
            symlink("deep/new", at("dangling")).unwrap();
            symlink("none/new", at("lost")).unwrap();
            write(&at("link"), b"new").unwrap();
            write(&at("dangling"), b"new").unwrap();
            for (link, file) in [("link", "deep/real"), ("dangling", "deep/new")] {
                assert!(at(link).is_symlink(), "{link}");
                assert_eq!(fs::read(at(file)).unwrap(), b"new");
            }
            let error = write(&at("lost"), b"new").unwrap_err().to_string();
            assert!(error.contains("there is no folder"), "{error}");
        }

        #[test]
        fn permissions_stay_and_new_files_have_those_of_the_umask() {
            let folder = tempfile::tempdir().unwrap();
            let at = |name: &str| folder.path().join(name);
            let mode = |name: &str| fs::metadata(at(name)).unwrap().permissions().mode() & 0o7777;
            fs::write(at("plain"), "").unwrap();
            write(&at("new"), b"").unwrap();
            assert_eq!(mode("new"), mode("plain"), "as any program makes a file");
            fs::set_permissions(at("plain"), Permissions::from_mode(0o640)).unwrap();
            write(&at("plain"), b"x").unwrap();
            assert_eq!(mode("plain"), 0o640);
        }

        #[test]
        fn what_is_no_file_is_written_to() {
            write(Path::new("/dev/null"), b"x").unwrap();
            assert!(fs::metadata("/dev/null").unwrap().file_type().is_char_device());
            let folder = tempfile::tempdir().unwrap();
            let pipe = folder.path().join("pipe");
            assert!(Command::new("mkfifo").arg(&pipe).status().unwrap().success());
            let reader = thread::spawn({
                let pipe = pipe.clone();
                move || {
                    let mut text = String::new();
                    File::open(pipe).unwrap().read_to_string(&mut text).map(|_| text)
                }
            });
            write(&pipe, b"through").unwrap();
            assert_eq!(reader.join().unwrap().unwrap(), "through");
            assert!(fs::metadata(&pipe).unwrap().file_type().is_fifo());
            let error = open_stream(&pipe, Duration::from_millis(50)).unwrap_err().to_string();
            assert!(error.contains("no program opened the pipe"), "{error}");
        }

        #[cfg(target_os = "linux")]
        #[test]
        fn a_full_device_says_so() {
            let error = write(Path::new("/dev/full"), b"x").unwrap_err().to_string();
            assert!(error.starts_with("cannot write /dev/full: No space left"), "{error}");
        }
    }
}
