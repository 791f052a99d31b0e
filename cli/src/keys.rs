//! Key files: the secret that a robot shares with its hosts.
//!
//! A file is one line of text, so that it survives copying and no other file is mistaken for it:
//! `rollwalk-link-key-1 ` and 64 hexadecimal digits.

use crate::kind::Kind;
use crate::{files, output};
use miette::{IntoDiagnostic, WrapErr, miette};
use rollwalk_host::authentication::Credentials;
use rollwalk_protocol::wire::authentication::{LINK_KEY_LEN, LinkKey};
use std::fmt::Write;
use std::path::Path;

/// First word of a file with a link key.
const LINK: &str = "rollwalk-link-key-1";

/// Makes a file with a new link key.
///
/// # Errors
/// The file exists, or cannot be written.
pub fn new_link_key(path: &Path) -> miette::Result<()> {
    files::write_secret(path, &line(LINK, &random::<LINK_KEY_LEN>()?))
}

/// Reads a link key.
///
/// # Errors
/// The file cannot be read, or holds no link key.
pub fn link_key(path: &Path) -> miette::Result<LinkKey> {
    let text = files::read_text(path, Kind::LinkKey)?;
    warn_if_readable_by_others(path);
    let key = parse::<LINK_KEY_LEN>(LINK, &text).ok_or_else(|| {
        miette!(
            help = "`rollwalk keys new FILE` makes one",
            "{} is no link key: that is one line, `{LINK}` and {} hexadecimal digits",
            path.display(),
            2 * LINK_KEY_LEN
        )
    })?;
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

fn line(kind: &str, bytes: &[u8]) -> String {
    let mut line = format!("{kind} ");
    for byte in bytes {
        let _ = write!(line, "{byte:02x}");
    }
    line + "\n"
}

/// The bytes of a file of this kind.
fn parse<const N: usize>(kind: &str, text: &str) -> Option<[u8; N]> {
    let digits = text.trim_end().strip_prefix(kind)?.strip_prefix(' ')?;
    if digits.len() != 2 * N || !digits.bytes().all(|digit| digit.is_ascii_hexdigit()) {
        return None;
    }
    let mut bytes = [0; N];
    for (byte, at) in bytes.iter_mut().zip((0..).step_by(2)) {
        *byte = u8::from_str_radix(digits.get(at..at + 2)?, 16).ok()?;
    }
    Some(bytes)
}

/// Says that a file with a secret can be read by others.
#[cfg(unix)]
pub fn warn_if_readable_by_others(path: &Path) {
    use std::os::unix::fs::PermissionsExt;
    // A pipe has no permissions that matter.
    let found = std::fs::metadata(path).ok().filter(std::fs::Metadata::is_file);
    if found.is_some_and(|found| found.permissions().mode() & 0o077 != 0) {
        let path = path.display();
        output::say(format_args!(
            "other users of this computer can read the key in {path}: chmod 600 {path}"
        ));
    }
}

/// Says nothing: permissions of files are unknown here.
#[cfg(not(unix))]
pub fn warn_if_readable_by_others(_: &Path) {}

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
        let digits = "0".repeat(64);
        for bad in [
            String::new(),
            digits.clone(),
            format!("{LINK} {}", &digits[1..]),
            format!("{LINK} {digits}0"),
            format!("{LINK} {}", "é".repeat(32)),
            format!("{LINK} +{}", &digits[1..]),
            format!("rollwalk-link-key-2 {digits}"),
        ] {
            fs::write(&path, bad).unwrap();
            let error = link_key(&path).unwrap_err().to_string();
            assert!(error.contains("is no link key"), "{error}");
        }
        fs::write(&path, format!("{LINK} {}", digits.replace("00", "aF"))).unwrap();
        link_key(&path).unwrap();
    }
}
