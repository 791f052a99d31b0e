//! Link keys: the secret that a robot shares with its hosts. [`key_file`] is the file format.

use crate::kind::Kind;
use crate::{files, output};
use miette::{IntoDiagnostic, WrapErr, miette};
use rollwalk_host::authentication::Credentials;
use rollwalk_host::key_file;
use rollwalk_protocol::wire::authentication::LinkKey;
use std::path::Path;

/// Creates a file with a new link key.
///
/// # Errors
/// Returns an error if the file exists or cannot be written.
pub fn new_link_key(path: &Path) -> miette::Result<()> {
    files::write_secret(path, &key_file::text(&random()?))
}

/// Reads a link key.
///
/// # Errors
/// Returns an error if the file cannot be read or does not contain a link key.
pub fn link_key(path: &Path) -> miette::Result<LinkKey> {
    let text = files::read_text(path, Kind::LinkKey)?;
    let key = key_file::parse(&text).ok_or_else(|| {
        miette!(
            help = "make a link key with `rollwalk keys new FILE`",
            "{} {}",
            path.display(),
            key_file::refusal()
        )
    })?;
    warn_if_readable_by_others(path);
    Ok(LinkKey::new(&key))
}

/// Reads a link key and draws a nonce, for a session.
///
/// # Errors
/// Returns the errors of [`link_key`], and an error if the operating system provides no random numbers.
pub fn credentials(path: &Path) -> miette::Result<Credentials> {
    Ok(Credentials { key: link_key(path)?, nonce: u64::from_le_bytes(random()?) })
}

/// Returns random bytes from the operating system.
///
/// # Errors
/// Returns an error if the operating system provides none.
pub fn random<const N: usize>() -> miette::Result<[u8; N]> {
    let mut bytes = [0; N];
    getrandom::fill(&mut bytes)
        .into_diagnostic()
        .wrap_err("the operating system returned no random numbers")?;
    Ok(bytes)
}

/// Warns if other users can read a file that contains a secret.
pub fn warn_if_readable_by_others(path: &Path) {
    if key_file::is_open_to_others(path) {
        let path = path.display();
        output::print_line(format_args!(
            "other users of this computer can read the key in {path}; to prevent that, type chmod \
             600 {path}"
        ));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fs;

    #[test]
    fn a_key_is_made_once_and_for_its_user_alone() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("robot.key");
        new_link_key(&path).unwrap();
        let text = fs::read_to_string(&path).unwrap();
        assert!(text.starts_with("rollwalk-link-key-1 ") && text.len() == 85, "{text}");
        link_key(&path).unwrap();
        #[cfg(unix)]
        {
            use std::os::unix::fs::PermissionsExt;
            assert_eq!(fs::metadata(&path).unwrap().permissions().mode() & 0o777, 0o600);
        }
        let error = new_link_key(&path).unwrap_err().to_string();
        assert!(error.contains("exists"), "{error}");
        assert_eq!(fs::read_to_string(&path).unwrap(), text, "it is as before");
        let other = folder.path().join("other.key");
        new_link_key(&other).unwrap();
        assert_ne!(fs::read_to_string(&other).unwrap(), text);
    }

    #[test]
    fn what_is_no_key_says_so() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("x");
        fs::write(&path, "x").unwrap();
        let error = link_key(&path).unwrap_err().to_string();
        assert!(
            error.contains("x is not a link key; expected one line with `rollwalk-link-key-1`"),
            "{error}"
        );
    }
}
