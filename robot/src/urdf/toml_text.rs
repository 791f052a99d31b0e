//! TOML text of strings, keys, numbers and arrays.

use super::names::allowed;
use std::fmt::Write;

/// Key of TOML for a name.
pub(super) fn key(name: &str) -> String {
    if allowed(name) == name { name.to_owned() } else { quoted(name) }
}

/// Quoted string of TOML.
pub(super) fn quoted(text: &str) -> String {
    let mut quoted = String::from('"');
    for c in text.chars() {
        match c {
            '"' | '\\' => quoted.extend(['\\', c]),
            c if c.is_control() => {
                let _ = write!(quoted, "\\u{:04X}", u32::from(c));
            }
            c => quoted.push(c),
        }
    }
    quoted.push('"');
    quoted
}

/// Text for a comment, without control characters.
pub(super) fn comment(text: &str) -> String {
    text.chars().map(|c| if c.is_control() { ' ' } else { c }).collect()
}

/// Number with twelve digits, which hide the rounding of rotations.
pub(super) fn show(number: f64) -> String {
    let rounded: f64 = format!("{number:.11e}").parse().unwrap_or(number);
    // Prints 0 without a minus sign.
    format!("{:?}", rounded + 0.0)
}

/// Array in which rounding errors next to 0 become 0.
pub(super) fn array(numbers: &[f64]) -> String {
    let largest = numbers.iter().fold(0.0_f64, |largest, number| largest.max(number.abs()));
    let shown: Vec<_> = numbers
        .iter()
        .map(|number| if number.abs() < 1e-13 * largest { "0.0".to_owned() } else { show(*number) })
        .collect();
    format!("[{}]", shown.join(", "))
}
