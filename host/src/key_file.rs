//! Files with link keys: the secret that a robot shares with its hosts, as text.
//!
//! A file consists of a single line: `rollwalk-link-key-1 ` and 64 hexadecimal digits. It thus survives copying, and other
//! files are not mistaken for it. Public and private keys of libraries are in PEM, the format of other tools.

use rollwalk_protocol::wire::authentication::LINK_KEY_LEN;
use std::fmt::Write;
use std::path::Path;

/// First word of a file with a link key.
pub const LINK: &str = "rollwalk-link-key-1";

/// Text of a file with the given link key.
pub fn text(key: &[u8; LINK_KEY_LEN]) -> String {
    let mut line = format!("{LINK} ");
    for byte in key {
        let _ = write!(line, "{byte:02x}");
    }
    line + "\n"
}

/// Parses the text of a file with a link key; `None` if the text is not a link key.
pub fn parse(text: &str) -> Option<[u8; LINK_KEY_LEN]> {
    let digits = text.trim_end().strip_prefix(LINK)?.strip_prefix(' ')?;
    if digits.len() != 2 * LINK_KEY_LEN || !digits.bytes().all(|digit| digit.is_ascii_hexdigit()) {
        return None;
    }
    let mut key = [0; LINK_KEY_LEN];
    for (byte, at) in key.iter_mut().zip((0..).step_by(2)) {
        *byte = u8::from_str_radix(digits.get(at..at + 2)?, 16).ok()?;
    }
    Some(key)
}

/// Error text for a file without a link key, to follow the file's name.
pub fn refusal() -> String {
    format!(
        "is not a link key; expected one line with `{LINK}` and {} hexadecimal digits",
        2 * LINK_KEY_LEN
    )
}

/// True if other users of this computer can read the file.
#[cfg(unix)]
pub fn is_open_to_others(path: &Path) -> bool {
    use std::os::unix::fs::PermissionsExt;
    // Permissions of a pipe do not matter.
    let found = std::fs::metadata(path).ok().filter(std::fs::Metadata::is_file);
    found.is_some_and(|found| found.permissions().mode() & 0o077 != 0)
}

/// Returns false: file permissions are unknown on this system.
#[cfg(not(unix))]
pub fn is_open_to_others(_: &Path) -> bool {
    false
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_key_survives_its_file() {
        let key = std::array::from_fn(|i| 0xF0 | i as u8);
        let text = text(&key);
        assert!(text.starts_with("rollwalk-link-key-1 f0f1f2") && text.len() == 85, "{text}");
        assert_eq!(parse(&text), Some(key));
        assert_eq!(
            parse(&text.to_uppercase().replace("ROLLWALK-LINK-KEY", "rollwalk-link-key")),
            Some(key)
        );
    }

    #[test]
    fn other_texts_are_no_keys() {
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
            assert_eq!(parse(&bad), None, "{bad}");
        }
    }
}
