//! Reading with size limits, and errors that suggest a remedy.

use super::{FileError, identity, missing};
use crate::kind::Kind;
use crate::shipped;
use std::fs::{self, File, FileType};
use std::io::{self, Read};
use std::path::Path;
use std::sync::mpsc::{RecvTimeoutError, sync_channel};
use std::thread;
use std::time::Duration;

/// Timeout of a pipe or device that sends nothing.
const PATIENCE: Duration = Duration::from_secs(30);

/// Source of the path of a file that is to be read.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PathSource<'n> {
    /// The user, who may also name a pipe, such as `<(program)` of a shell.
    ByUser,
    /// Another file, which may be untrusted: only regular files are read.
    InFile {
        /// Path as the other file contains it.
        named: &'n str,
    },
}

/// Reads the bytes of a file that the user named.
pub fn read(path: &Path, kind: Kind) -> miette::Result<Vec<u8>> {
    Ok(read_by(path, PathSource::ByUser, |_| kind)?.0)
}

/// Reads the text of a file that the user named.
pub fn read_text(path: &Path, kind: Kind) -> miette::Result<String> {
    Ok(text(read_by(path, PathSource::ByUser, |_| kind)?, path)?)
}

/// Converts bytes to text.
///
/// # Errors
/// Returns an error if the bytes are not UTF-8.
pub fn text((bytes, kind): (Vec<u8>, Kind), path: &Path) -> Result<String, FileError> {
    String::from_utf8(bytes).map_err(|_| FileError::NotText { kind, path: path.to_owned() })
}

/// Reads a file up to the size limit of its kind, and returns its bytes and its kind.
///
/// `kind_of` determines the kind from the first bytes. If no file exists at the path, the shipped file of that path is read,
/// or the one of the path that another file contains.
///
/// # Errors
/// Returns an error if the file does not exist or is too large, or if the operating system refuses.
pub fn read_by(
    path: &Path,
    named: PathSource<'_>,
    kind_of: impl Fn(&[u8]) -> Kind,
) -> Result<(Vec<u8>, Kind), FileError> {
    let as_named = match named {
        PathSource::ByUser => None,
        PathSource::InFile { named } => Some(named),
    };
    let refused = |reason| refused(path, as_named, kind_of(&[]), reason);
    let text = match as_named {
        None => shipped::instead_of(path),
        Some(named) => shipped::instead_of_named(path, named),
    };
    if let Some(text) = text {
        let kind = kind_of(text.as_bytes());
        identity::record_shipped(path, kind);
        return Ok((text.into(), kind));
    }
    let found = fs::metadata(path).map_err(refused)?;
    if found.is_file() {
        let mut file = File::open(path).map_err(refused)?;
        let mut content = Bounded::new(path, &kind_of, Some(found.len()));
        let mut chunk = [0; 1 << 16];
        loop {
            match file.read(&mut chunk) {
                Ok(0) => break,
                Ok(length) => content.take(&chunk[..length])?,
                Err(error) if error.kind() == io::ErrorKind::Interrupted => {}
                Err(error) => return Err(refused(error)),
            }
        }
        let (bytes, kind) = content.finish();
        identity::record_input(file, path, kind);
        return Ok((bytes, kind));
    }
    if named != PathSource::ByUser {
        let (kind, found) = (kind_of(&[]), word_for(found.file_type()));
        let help = Some(format!("name a {kind} there"));
        return Err(FileError::NotAFile { kind, path: path.to_owned(), found, help });
    }
    if found.is_dir() {
        return Err(missing::given_folder(path.to_owned(), kind_of(&[])));
    }
    stream(path, &kind_of, PATIENCE)
}

/// Checks that a file that the user named exists and is no folder.
///
/// # Errors
/// Returns the errors of [`read_by`] for such a path.
pub fn check(path: &Path, kind: Kind) -> Result<(), FileError> {
    if shipped::instead_of(path).is_some() {
        return Ok(());
    }
    match fs::metadata(path) {
        Ok(found) if found.is_dir() => Err(missing::given_folder(path.to_owned(), kind)),
        Ok(_) => Ok(()),
        Err(reason) => Err(refused(path, None, kind, reason)),
    }
}

/// Error for a path that the operating system refuses. `named` is the path that another file contains.
fn refused(path: &Path, named: Option<&str>, kind: Kind, reason: io::Error) -> FileError {
    let path = path.to_owned();
    match reason.kind() {
        io::ErrorKind::NotFound => missing::report(path, named, kind),
        _ => FileError::Io { action: "read", path, reason },
    }
}

/// Bytes received so far, limited to the maximum size of the kind.
struct Bounded<'a, K> {
    path: &'a Path,
    kind_of: &'a K,
    kind: Option<Kind>,
    length: Option<u64>,
    bytes: Vec<u8>,
}

impl<'a, K: Fn(&[u8]) -> Kind> Bounded<'a, K> {
    fn new(path: &'a Path, kind_of: &'a K, length: Option<u64>) -> Self {
        Self { path, kind_of, kind: None, length, bytes: Vec::new() }
    }

    fn take(&mut self, chunk: &[u8]) -> Result<(), FileError> {
        let kind = *self.kind.get_or_insert_with(|| (self.kind_of)(chunk));
        let so_far = (self.bytes.len() + chunk.len()) as u64;
        // A length known from the start need not be read first.
        if so_far.max(self.length.unwrap_or(0)) > kind.max_bytes() {
            let bytes = self.length.filter(|length| *length >= so_far);
            return Err(FileError::TooLarge { kind, path: self.path.to_owned(), bytes });
        }
        self.bytes.extend_from_slice(chunk);
        Ok(())
    }

    fn finish(self) -> (Vec<u8>, Kind) {
        let kind = self.kind.unwrap_or_else(|| (self.kind_of)(&[]));
        (self.bytes, kind)
    }
}

/// Reads a pipe or a device, which may stay silent or never end.
fn stream(
    path: &Path,
    kind_of: &impl Fn(&[u8]) -> Kind,
    patience: Duration,
) -> Result<(Vec<u8>, Kind), FileError> {
    let (sender, chunks) = sync_channel(1);
    let source = path.to_owned();
    // Opening a pipe waits, too. A thread that waits for ever ends with the process.
    thread::spawn(move || {
        let send = || -> io::Result<()> {
            let mut file = File::open(source)?;
            let mut chunk = [0; 1 << 16];
            loop {
                let length = file.read(&mut chunk)?;
                if length == 0 || sender.send(Ok(chunk[..length].to_vec())).is_err() {
                    return Ok(());
                }
            }
        };
        if let Err(error) = send() {
            // The receiver is gone, because the file was too large.
            let _ = sender.send(Err(error));
        }
    });
    let mut content = Bounded::new(path, kind_of, None);
    loop {
        match chunks.recv_timeout(patience) {
            Ok(Ok(chunk)) => content.take(&chunk)?,
            Ok(Err(reason)) => {
                return Err(FileError::Io { action: "read", path: path.to_owned(), reason });
            }
            Err(RecvTimeoutError::Disconnected) => return Ok(content.finish()),
            Err(RecvTimeoutError::Timeout) => {
                let seconds = patience.as_secs();
                return Err(FileError::Silent { path: path.to_owned(), seconds });
            }
        }
    }
}

/// Name of the type of a path that is not a regular file.
fn word_for(found: FileType) -> &'static str {
    #[cfg(unix)]
    {
        use std::os::unix::fs::FileTypeExt;
        if found.is_fifo() {
            return "a pipe";
        }
        if found.is_socket() {
            return "a socket";
        }
    }
    if found.is_dir() { "a folder" } else { "a device" }
}

#[cfg(test)]
mod tests {
    use super::*;

    const IN_FILE: PathSource<'_> = PathSource::InFile { named: "x" };

    #[test]
    fn a_file_has_no_more_bytes_than_its_kind() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("robot.toml");
        let most = Kind::Robot.max_bytes();
        fs::write(&path, vec![b'#'; most as usize]).unwrap();
        assert_eq!(read(&path, Kind::Robot).unwrap().len() as u64, most);
        fs::write(&path, vec![b'#'; most as usize + 1]).unwrap();
        let error = read(&path, Kind::Robot).unwrap_err().to_string();
        assert!(
            error.ends_with("has 1048577 bytes; a robot file (TOML) has at most 1048576"),
            "{error}"
        );
        // The beginning of the file tells its kind.
        let plan = |start: &[u8]| if start.starts_with(b"#") { Kind::Plan } else { Kind::Robot };
        assert_eq!(read_by(&path, PathSource::ByUser, plan).unwrap().1, Kind::Plan);
    }

    #[cfg(unix)]
    #[test]
    fn what_has_no_end_is_read_up_to_the_bound() {
        let error = read(Path::new("/dev/zero"), Kind::Robot).unwrap_err().to_string();
        assert!(error.contains("/dev/zero has more than 1048576 bytes"), "{error}");
        let error = read_by(Path::new("/dev/zero"), IN_FILE, |_| Kind::Robot).unwrap_err();
        assert!(error.to_string().contains("/dev/zero: it is a device"), "{error}");
        let error = read(Path::new("/dev"), Kind::Robot).unwrap_err().to_string();
        assert!(error.contains("/dev: it is a folder"), "{error}");
    }

    #[cfg(unix)]
    #[test]
    fn a_pipe_is_read_to_its_end_or_given_up() {
        let folder = tempfile::tempdir().unwrap();
        let pipe = folder.path().join("pipe");
        let made = std::process::Command::new("mkfifo").arg(&pipe).status().unwrap();
        assert!(made.success());
        let kind_of = |_: &[u8]| Kind::Robot;
        let writer = thread::spawn({
            let pipe = pipe.clone();
            move || fs::write(pipe, "name = 1")
        });
        assert_eq!(stream(&pipe, &kind_of, PATIENCE).unwrap().0, b"name = 1");
        writer.join().unwrap().unwrap();
        let error = stream(&pipe, &kind_of, Duration::from_millis(50)).unwrap_err();
        assert!(error.to_string().contains("no data arrived"), "{error}");
        let error = read_by(&pipe, IN_FILE, kind_of).unwrap_err().to_string();
        assert!(error.contains("it is a pipe, not a file"), "{error}");
    }
}
