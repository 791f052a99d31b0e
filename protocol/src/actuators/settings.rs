//! Settings of codecs: reading them from a robot file, and reporting wrong ones.
//!
//! The reader of robot files implements both traits; a codec names its keys and their ranges.

use core::fmt::Arguments;
use core::ops::RangeInclusive;

/// The keys of a `[[bus]]` table. The reader reports a key that is missing or wrong, and gives a
/// placeholder for it: 0, `false` or the first word.
pub trait Keys {
    /// True if the key is present.
    fn has(&self, key: &'static str) -> bool;

    /// A number.
    fn number(&self, key: &'static str) -> f32;

    /// A whole number within a range.
    fn integer(&self, key: &'static str, range: RangeInclusive<u32>) -> u32;

    /// `true` or `false`.
    fn boolean(&self, key: &'static str) -> bool;

    /// An array of two numbers.
    fn pair(&self, key: &'static str) -> (f32, f32);

    /// Reads a word and returns its index in `words`.
    fn choice(&self, key: &'static str, words: &[&'static str]) -> usize;

    /// Reports a value that the codec refuses.
    fn refuse(&self, key: &'static str, problem: &str, label: &str, help: &str);
}

/// The value of a key that may be left out, or the default.
pub(super) fn or<T>(
    keys: &dyn Keys,
    key: &'static str,
    default: T,
    read: impl FnOnce(&'static str) -> T,
) -> T {
    if keys.has(key) { read(key) } else { default }
}

/// Collects settings that no actuator can have, wherever they came from.
pub trait Report {
    /// Reports that the setting `key` has a `problem`; `help` states valid values.
    fn violated(&mut self, key: &'static str, problem: Arguments<'_>, help: Arguments<'_>);
}

/// Reports a whole number out of its range.
pub(super) fn check_integer(
    report: &mut dyn Report,
    key: &'static str,
    value: u32,
    range: RangeInclusive<u32>,
    unit: &str,
) {
    if !range.contains(&value) {
        let (least, most) = range.into_inner();
        let help = format_args!("allowed is {least} to {most}{unit}");
        report.violated(key, format_args!("is {value}{unit}"), help);
    }
}
