//! Writing of keys. A key never replaces a file, and a pair of keys is written completely or not at all.

use super::folder;
use super::write::{cannot_write, temporary_in};
use miette::{Report, miette};
use std::fs;
use std::io::{self, Write};
use std::path::Path;
use tempfile::NamedTempFile;

/// Creates a file that only its owner can read.
///
/// # Errors
/// Returns an error if the file exists, or if the operating system refuses.
pub fn write_secret(path: &Path, content: &str) -> miette::Result<()> {
    if path == Path::new("-") {
        return Err(miette!("a key cannot be written to standard output (`-`): give a file name"));
    }
    let file = secret_in(folder(path)).and_then(|file| filled(file, content.as_bytes()));
    keep_new(file.map_err(|reason| cannot_write(path, reason))?, path)
}

/// Writes the two files of a key pair, the secret one readable only by its owner. If either file exists or cannot be written,
/// neither is written.
///
/// # Errors
/// Returns the errors of [`write_secret`].
pub fn write_pair(secret: (&Path, &str), public: (&Path, &str)) -> miette::Result<()> {
    write_pair_with(secret, public, filled)
}

/// Writes a key pair; `fill` writes the content of a file, which a test lets fail as on a full disk. Both files are complete
/// before either gets its name.
fn write_pair_with(
    (path, content): (&Path, &str),
    (public, public_content): (&Path, &str),
    mut fill: impl FnMut(NamedTempFile, &[u8]) -> io::Result<NamedTempFile>,
) -> miette::Result<()> {
    refuse_existing(public)?;
    let other = temporary_in(folder(public)).and_then(|file| fill(file, public_content.as_bytes()));
    let other = other.map_err(|reason| cannot_write(public, reason))?;
    let file = secret_in(folder(path)).and_then(|file| fill(file, content.as_bytes()));
    keep_new(file.map_err(|reason| cannot_write(path, reason))?, path)?;
    keep_new(other, public).inspect_err(|_| {
        // A key without its other half would prevent the next attempt.
        let _ = fs::remove_file(path);
    })
}

/// Renames a temporary file to `path`, unless a file exists there.
fn keep_new(file: NamedTempFile, path: &Path) -> miette::Result<()> {
    file.persist_noclobber(path).map(drop).map_err(|error| match error.error.kind() {
        io::ErrorKind::AlreadyExists => key_exists(path),
        _ => cannot_write(path, error.error),
    })
}

/// Writes the content into a file and syncs it to the disk.
fn filled(mut file: NamedTempFile, content: &[u8]) -> io::Result<NamedTempFile> {
    file.as_file_mut().write_all(content)?;
    file.as_file().sync_all()?;
    Ok(file)
}

/// Creates a temporary file that only its owner can read.
fn secret_in(folder: &Path) -> io::Result<NamedTempFile> {
    let made = tempfile::Builder::new().prefix(".rollwalk-").tempfile_in(folder);
    made.map_err(|error| io::Error::from(error.kind()))
}

/// Refuses to create a key where a file exists.
///
/// # Errors
/// Returns an error if a file exists at `path`.
fn refuse_existing(path: &Path) -> miette::Result<()> {
    if path.symlink_metadata().is_ok() { Err(key_exists(path)) } else { Ok(()) }
}

fn key_exists(path: &Path) -> Report {
    miette!(
        help = "give another file name, or remove the existing key if no robot uses it any more",
        "cannot write {}: the file exists, and keys are never overwritten",
        path.display()
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::files::names;

    #[test]
    fn a_pair_of_keys_is_whole_or_not_there() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        let missing = folder.path().join("none/owner.pub.pem");
        write_pair((&at("owner.pem"), "secret"), (&missing, "public")).unwrap_err();
        assert!(names(folder.path()).is_empty());
        fs::write(at("other.pub.pem"), "theirs").unwrap();
        write_pair((&at("other.pem"), "secret"), (&at("other.pub.pem"), "public")).unwrap_err();
        assert_eq!(names(folder.path()), ["other.pub.pem"]);
        fs::write(at("mine.pem"), "mine").unwrap();
        write_pair((&at("mine.pem"), "secret"), (&at("mine.pub.pem"), "public")).unwrap_err();
        assert_eq!(fs::read_to_string(at("mine.pem")).unwrap(), "mine");
        assert!(!at("mine.pub.pem").exists());
        // The second file fails after the first has its name.
        let taken = secret_in(folder.path()).unwrap();
        keep_new(taken, &at("mine.pem")).unwrap_err();
        write_pair((&at("good.pem"), "secret"), (&at("good.pub.pem"), "public")).unwrap();
        assert_eq!(fs::read_to_string(at("good.pub.pem")).unwrap(), "public");
        #[cfg(unix)]
        {
            use std::os::unix::fs::PermissionsExt;
            let mode = |name| fs::metadata(at(name)).unwrap().permissions().mode() & 0o777;
            assert_eq!(mode("good.pem"), 0o600);
        }
        let mut left = names(folder.path());
        left.sort();
        assert_eq!(left, ["good.pem", "good.pub.pem", "mine.pem", "other.pub.pem"]);
    }

    /// The disk is full while either file is written, or another program takes the name of the second file meanwhile.
    #[test]
    fn a_full_disk_leaves_no_half_of_a_pair() {
        let folder = tempfile::tempdir().unwrap();
        let (secret, public) = (folder.path().join("own.pem"), folder.path().join("own.pub.pem"));
        for full_at in [1, 2] {
            let mut written = 0;
            let error =
                write_pair_with((&secret, "secret"), (&public, "public"), |file, content| {
                    written += 1;
                    if written < full_at {
                        return filled(file, content);
                    }
                    // Part of the content still fits.
                    filled(file, &content[..3])?;
                    Err(io::ErrorKind::StorageFull.into())
                });
            let error = error.unwrap_err().to_string();
            let name = if full_at == 1 { "own.pub.pem" } else { "own.pem" };
            assert!(error.contains(name) && error.contains("no storage space"), "{error}");
            assert_eq!(names(folder.path()), [""; 0], "write {full_at}");
        }
        let taken = write_pair_with((&secret, "secret"), (&public, "public"), |file, content| {
            if content == b"secret" {
                fs::write(&public, "theirs")?;
            }
            filled(file, content)
        });
        taken.unwrap_err();
        assert_eq!(names(folder.path()), ["own.pub.pem"]);
        assert_eq!(fs::read_to_string(&public).unwrap(), "theirs");
    }

    #[test]
    fn a_secret_is_never_printed() {
        let error = write_secret(Path::new("-"), "secret").unwrap_err().to_string();
        assert!(error.contains("a key cannot be written to standard output"), "{error}");
        assert!(!Path::new("-").exists());
    }
}
