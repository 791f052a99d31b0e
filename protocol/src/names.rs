//! Detection of names that look like others on a screen, by the tables of Unicode (UAX 15, UTS 39). For hosts.

use unicode_normalization::is_nfc;
use unicode_security::{MixedScript, skeleton};

/// Problem of a name that can be mistaken for another one, as a clause that continues a sentence after the name. `None` if
/// there is no problem.
pub fn problem(name: &str) -> Option<&'static str> {
    if !is_nfc(name) {
        Some("has a letter and its accent as two characters (it is not in NFC)")
    } else if !name.is_single_script() {
        Some("has letters of several scripts, such as Latin and Cyrillic")
    } else {
        None
    }
}

/// Advice for a name that has a [`problem`].
pub const HELP: &str = "type the name again with letters of one script and composed accents";

/// True if two different names look the same. Two ASCII names never do, since monospaced fonts distinguish `l` from `1`.
pub fn are_confusable(one: &str, other: &str) -> bool {
    one != other && !(one.is_ascii() && other.is_ascii()) && skeleton(one).eq(skeleton(other))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_of_one_script_in_composed_form_are_fine() {
        for name in ["walk", "Übung 2", "turn_in-place.v2", "走", "ходьба 2", "περπάτημα", "歩く"]
        {
            assert_eq!(problem(name), None, "{name}");
        }
        for (name, words) in [
            ("w\u{430}lk", "several scripts"),
            ("wal\u{43A}", "several scripts"),
            ("\u{3C9}alk", "several scripts"),
            ("U\u{308}bung", "two characters"),
            ("cafe\u{301}", "two characters"),
            ("\u{212B}", "two characters"),
        ] {
            assert!(problem(name).is_some_and(|found| found.contains(words)), "{name}");
        }
    }

    #[test]
    fn names_that_look_the_same_are_found() {
        for (one, other) in [
            ("cop", "\u{441}\u{43E}\u{440}"),
            ("TOP", "\u{422}\u{41E}\u{420}"),
            ("\u{DC}bung", "U\u{308}bung"),
            ("walk", "\u{1D430}alk"),
            ("o", "\u{3BF}"),
        ] {
            assert!(are_confusable(one, other) && are_confusable(other, one), "{one} {other}");
        }
        for (one, other) in [("walk", "walk"), ("walk1", "walkl"), ("Übung", "Ubung"), ("走", "歩")]
        {
            assert!(!are_confusable(one, other), "{one} {other}");
        }
    }
}
