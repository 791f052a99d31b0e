//! Key files: the secret that a robot shares with its hosts, made and read ([`key_file`] is what they look like).

use crate::kind::Kind;
use crate::{files, output};
use miette::{IntoDiagnostic, WrapErr, miette};
use rollwalk_host::authentication::Credentials;
use rollwalk_host::key_file;
use rollwalk_protocol::wire::authentication::LinkKey;
use std::path::Path;

/// Makes a file with a new link key.
///
/// # Errors
/// The file exists, or cannot be written.
pub fn new_link_key(path: &Path) -> miette::Result<()> {
    files::write_secret(path, &key_file::text(&random()?))
}

/// Reads a link key.
///
/// # Errors
/// The file cannot be read, or holds no link key.
pub fn link_key(path: &Path) -> miette::Result<LinkKey> {
    let text = files::read_text(path, Kind::LinkKey)?;
    let key = key_file::parse(&text).ok_or_else(|| {
        miette!(
            help = "`rollwalk keys new FILE` makes one",
            "{} {}",
            path.display(),
            key_file::refusal()
        )
    })?;
    warn_if_readable_by_others(path);
    Ok(LinkKey::new(&key))
}

/// Reads a link key for sessions.
///
/// # Errors
/// As [`link_key`], or the operating system has no random numbers.
pub fn credentials(path: &Path) -> miette::Result<Credentials> {
    Ok(Credentials { key: link_key(path)?, nonce: u64::from_le_bytes(random()?) })
}

/// Random bytes of the operating system.
///
/// # Errors
/// It has none.
pub fn random<const N: usize>() -> miette::Result<[u8; N]> {
    let mut bytes = [0; N];
    getrandom::fill(&mut bytes)
        .into_diagnostic()
        .wrap_err("the operating system gave no random numbers")?;
    Ok(bytes)
}

/// Says that a file with a secret can be read by others.
pub fn warn_if_readable_by_others(path: &Path) {
    if key_file::is_open_to_others(path) {
        let path = path.display();
        output::say(format_args!(
            "other users of this computer can read the key in {path}: chmod 600 {path}"
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
            error.contains("x is no link key: that is one line, `rollwalk-link-key-1`"),
            "{error}"
        );
    }
}
