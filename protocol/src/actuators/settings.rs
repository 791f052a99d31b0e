//! Interface between codecs and the reader of robot files, for reading settings and reporting wrong ones.
//!
//! The reader implements both traits. A codec names its keys and their ranges.

use core::fmt::Arguments;
use core::ops::RangeInclusive;

/// Keys of a `[[bus]]` table. The reader reports a missing or wrong key, and returns a placeholder for it: 0, `false` or the
/// first word.
pub trait Keys {
    /// True if the key is present.
    fn has(&self, key: &'static str) -> bool;

    /// Reads a number.
    fn number(&self, key: &'static str) -> f32;

    /// Reads an integer within a range.
    fn integer(&self, key: &'static str, range: RangeInclusive<u32>) -> u32;

    /// Reads a boolean.
    fn boolean(&self, key: &'static str) -> bool;

    /// Reads an array of two numbers.
    fn pair(&self, key: &'static str) -> (f32, f32);

    /// Reads a word and returns its index in `words`.
    fn choice(&self, key: &'static str, words: &[&'static str]) -> usize;

    /// Reports a value that the codec refuses.
    fn refuse(&self, key: &'static str, problem: &str, label: &str, help: &str);
}

/// Reads an optional key; returns `default` if it is absent.
pub(super) fn or<T>(
    keys: &dyn Keys,
    key: &'static str,
    default: T,
    read: impl FnOnce(&'static str) -> T,
) -> T {
    if keys.has(key) { read(key) } else { default }
}

/// Collects settings that no actuator can have, whatever their source.
pub trait Report {
    /// Reports that the setting `key` has a `problem`; `help` states valid values.
    fn violated(&mut self, key: &'static str, problem: Arguments<'_>, help: Arguments<'_>);
}

/// Reports an integer that is not in its range.
pub(super) fn check_integer(
    report: &mut dyn Report,
    key: &'static str,
    value: u32,
    range: RangeInclusive<u32>,
    unit: &str,
) {
    if !range.contains(&value) {
        let (least, most) = range.into_inner();
        let help = format_args!("give a value from {least} to {most}{unit}");
        report.violated(key, format_args!("is {value}{unit}"), help);
    }
}
