//! Safe printing of untrusted text: names in libraries, files and messages.
//!
//! Terminals interpret control characters. Formatting characters reorder or hide the text next to them. A name with either can
//! be mistaken for another. This module is for hosts; a controller prints nothing.

use core::fmt::{self, Write};
use core::str::FromStr;

/// True for characters that change how a terminal shows other ones: control characters, line and paragraph separators,
/// direction marks, and characters without width.
pub fn is_hidden(c: char) -> bool {
    c.is_control()
        || matches!(c,
            '\u{AD}' | '\u{61C}' | '\u{180E}' | '\u{200B}'..='\u{200F}' | '\u{2028}'..='\u{202E}'
            | '\u{2060}'..='\u{206F}' | '\u{FEFF}' | '\u{FFF9}'..='\u{FFFB}' | '\u{E0000}'..='\u{E0FFF}')
}

/// True if a printed name can be distinguished from others: it is not empty, and has no hidden characters and no space at its
/// ends.
pub fn is_plain_name(name: &str) -> bool {
    !name.is_empty() && name.trim() == name && !name.contains(is_hidden)
}

/// Name in a form that is safe to print. Hidden characters appear as `\u001b`, as in JSON.
#[derive(Clone, Copy, Debug)]
pub struct Printable<'a>(pub &'a str);

/// Text of several lines in a form that is safe to print, like [`Printable`] except that line breaks and tabs stay.
#[derive(Clone, Copy, Debug)]
pub struct ShownLines<'a>(pub &'a str);

/// Maximum number of characters of an [`Excerpt`], without the ellipses for omitted text.
const EXCERPT_MAX: usize = 100;
/// Number of characters of an [`Excerpt`] before its position.
const EXCERPT_BEFORE: usize = 40;

/// Excerpt of a text around a position, in a form that is safe to print in a message: [`Printable`], cut to about 100 characters.
#[derive(Clone, Copy, Debug)]
pub struct Excerpt<'a> {
    /// Whole text.
    pub text: &'a str,
    /// Position that the message refers to, byte index.
    pub at: usize,
}

impl<'a> Excerpt<'a> {
    /// Excerpt from the beginning of a text.
    pub fn start_of(text: &'a str) -> Self {
        Self { text, at: 0 }
    }
}

impl fmt::Display for Excerpt<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { text, at } = *self;
        let place = text.floor_char_boundary(at);
        let before = text[..place].char_indices().rev();
        let from = before.take(EXCERPT_BEFORE).last().map_or(place, |(byte, _)| byte);
        let end = text[from..].char_indices().nth(EXCERPT_MAX);
        let to = end.map_or(text.len(), |(byte, _)| from + byte);
        // Short texts are shown whole.
        let whole = text.char_indices().nth(EXCERPT_MAX).is_none();
        let (from, to) = if whole { (0, text.len()) } else { (from, to) };
        f.write_str(if from > 0 { "…" } else { "" })?;
        write_shown(f, &text[from..to], is_hidden)?;
        f.write_str(if to < text.len() { "…" } else { "" })
    }
}

impl fmt::Display for Printable<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write_shown(f, self.0, is_hidden)
    }
}

impl fmt::Display for ShownLines<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write_shown(f, self.0, |c| is_hidden(c) && !matches!(c, '\n' | '\t'))
    }
}

/// Number as shown in messages: with at most five significant digits, and without trailing zeros. Single-precision values would
/// otherwise print spurious digits.
#[derive(Clone, Copy, Debug)]
pub struct Number(pub f64);

/// Limit as shown in messages: with the digits of a [`Number`], but never rounded to a value that the limit excludes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Limit<T> {
    /// Smallest allowed value.
    AtLeast(T),
    /// Largest allowed value.
    AtMost(T),
}

impl From<f32> for Number {
    fn from(value: f32) -> Self {
        Self(value.into())
    }
}

impl fmt::Display for Number {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match digits(self.0, 0.0) {
            Some(digits) => f.write_str(&digits),
            None => write!(f, "{}", if self.0.abs() < 1e-9 { 0.0 } else { self.0 }),
        }
    }
}

impl<T: Copy + PartialOrd + Into<f64> + FromStr> fmt::Display for Limit<T> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        // Parses the text as the program would parse it if a user typed it.
        let is_allowed = |text: &str| {
            text.parse().is_ok_and(|given: T| match self {
                Self::AtLeast(least) => given >= *least,
                Self::AtMost(most) => given <= *most,
            })
        };
        let (limit, inwards) = match *self {
            Self::AtLeast(least) => (least.into(), 1.0),
            Self::AtMost(most) => (most.into(), -1.0),
        };
        let mut candidates = [0.0, inwards].into_iter().filter_map(|steps| digits(limit, steps));
        match candidates.find(|text| is_allowed(text)) {
            Some(text) => f.write_str(&text),
            // −0 plus 0 is 0.
            None => write!(f, "{}", 0.0 + limit),
        }
    }
}

/// Decimal digits of `value`, changed by `steps` units of its fifth digit, without trailing zeros. `None` below 1e-9, and from
/// 100,000 up, where more than five digits precede the point.
fn digits(value: f64, steps: f64) -> Option<heapless::String<32>> {
    let size = value.abs();
    if !(1e-9..1e5).contains(&size) {
        return None;
    }
    let (mut decimals, mut step, mut bound) = (0, 1.0, 1e4);
    while size < bound && decimals < 13 {
        decimals += 1;
        step /= 10.0;
        bound /= 10.0;
    }
    let mut digits = heapless::String::new();
    write!(digits, "{:.decimals$}", value + steps * step).ok()?;
    while decimals > 0 && digits.ends_with(['0', '.']) {
        // Zeros before the decimal point are digits of the number.
        decimals = if digits.pop() == Some('.') { 0 } else { decimals };
    }
    Some(digits)
}

fn write_shown(f: &mut fmt::Formatter<'_>, text: &str, is_hidden: fn(char) -> bool) -> fmt::Result {
    for c in text.chars() {
        if is_hidden(c) {
            for unit in c.encode_utf16(&mut [0; 2]) {
                write!(f, "\\u{unit:04x}")?;
            }
        } else {
            f.write_char(c)?;
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::format;

    #[test]
    fn what_a_terminal_would_obey_is_written_out() {
        for (text, shown) in [
            ("walk to übung, 5 N·m\n\tα", "walk to übung, 5 N·m\n\tα"),
            ("\x1b[2Jwalk\x07", "\\u001b[2Jwalk\\u0007"),
            ("a\rb\0\u{9b}1m\u{7f}", "a\\u000db\\u0000\\u009b1m\\u007f"),
            ("\u{202e}kcul", "\\u202ekcul"),
            ("\u{e0041}", "\\udb40\\udc41"),
        ] {
            assert_eq!(format!("{}", ShownLines(text)), shown);
        }
        assert_eq!(format!("{}", Printable("a\tb\n\x1b")), "a\\u0009b\\u000a\\u001b");
    }

    #[test]
    fn names_are_what_they_look_like() {
        for name in ["walk", "Übung 2", "turn_in-place.v2", "走"] {
            assert!(is_plain_name(name), "{name}");
        }
        for name in ["", " walk", "walk ", "wa\nlk", "walk\0", "walk\u{200b}", "\u{202e}klaw", "\t"]
        {
            assert!(!is_plain_name(name), "{name:?}");
        }
    }

    #[test]
    fn excerpts_of_long_texts_are_short_and_have_the_place() {
        let shown = |text: &str, at| format!("{}", Excerpt { text, at });
        assert_eq!(shown("a\u{1b}[2Jb", 3), "a\\u001b[2Jb");
        assert_eq!(shown("", 5), "");
        let exact = "x".repeat(100);
        assert_eq!(shown(&exact, 99), exact);
        let long = format!("{}FAULT{}", "ä".repeat(5000), "é".repeat(5000));
        let at = long.find('F').unwrap();
        for off in 0..3 {
            let text = shown(&long, at - off);
            assert!(text.contains("FAULT") && text.chars().count() == 102, "{text}");
        }
        let (start, end) = (shown(&long, 0), shown(&long, usize::MAX));
        assert!(start.starts_with('ä') && start.ends_with('…'), "{start}");
        assert!(end.starts_with('…') && end.ends_with('é'), "{end}");
    }

    #[test]
    fn numbers_have_the_digits_that_count() {
        for (value, shown) in [
            (0.0, "0"),
            (-0.0, "0"),
            (3.0, "3"),
            (-0.5, "-0.5"),
            (f64::from(0.1f32), "0.1"),
            (f64::from(655.35f32), "655.35"),
            (f64::from(0.3f32 * 3.0), "0.9"),
            (1.0 / 3.0, "0.33333"),
            (9.999_99, "10"),
            (1e-6, "0.000001"),
            (10_000.0, "10000"),
            (99_999.7, "100000"),
            (1_000_000.0, "1000000"),
            (f64::NAN, "NaN"),
            (f64::NEG_INFINITY, "-inf"),
        ] {
            assert_eq!(format!("{}", Number(value)), shown);
        }
        assert_eq!(format!("{}", Number::from(6.000_000_5f32)), "6");
    }

    #[test]
    fn a_limit_that_is_shown_is_allowed() {
        use core::f64::consts::TAU;
        for (least, most, limit) in [
            ("6.2832", "6.2831", TAU),
            ("-6.2831", "-6.2832", -TAU),
            ("0.66667", "0.66666", 2.0 / 3.0),
            ("10", "9.9999", 9.999_99),
            ("99999", "99998", 99_998.25),
            ("0.5", "0.5", 0.5),
            ("0", "0", -0.0),
            ("1000000.5", "1000000.5", 1_000_000.5),
            ("0.0000000001", "0.0000000001", 1e-10),
        ] {
            assert_eq!(format!("{}", Limit::AtLeast(limit)), least);
            assert_eq!(format!("{}", Limit::AtMost(limit)), most);
        }
        // In single precision, 655.35 prints as given.
        for limit in [655.35f32, 0.1, 6.5] {
            assert_eq!(format!("{}", Limit::AtMost(limit)), format!("{limit}"));
        }
        let mut size = 1e-12;
        while size < 1e9 {
            for limit in [size, -size] {
                let single = limit as f32;
                let read = |text: std::string::String| text.parse::<f64>().unwrap();
                assert!(read(format!("{}", Limit::AtLeast(limit))) >= limit, "{limit}");
                assert!(read(format!("{}", Limit::AtMost(limit))) <= limit, "{limit}");
                let read = |text: std::string::String| text.parse::<f32>().unwrap();
                assert!(read(format!("{}", Limit::AtLeast(single))) >= single, "{limit}");
                assert!(read(format!("{}", Limit::AtMost(single))) <= single, "{limit}");
            }
            size *= 1.003_7;
        }
    }
}
