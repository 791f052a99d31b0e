//! Logs in the format of `candump -l` (can-utils), which `canplayer`, `cantools` and Wireshark read.
//!
//! One line a frame: `(1700000000.123456) can0 123#DEADBEEF`, identifiers of 29 bits with eight digits.
//! The time is seconds since 1970, or in a simulation since its start.

use rollwalk_protocol::can::Frame;
use std::fmt;
use std::io;
use std::str::FromStr;

/// Bit of the identifier that marks an error report of the interface, which is not a frame.
const ERROR_FLAG: u32 = 0x2000_0000;

/// A frame on an interface at an instant; prints as a line of the log.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct LogEntry<I = String> {
    /// Instant at which the frame ended, µs.
    pub at_us: u64,
    /// The bus; its name has no spaces.
    pub interface: I,
    /// The frame.
    pub frame: Frame,
}

impl<I: fmt::Display> fmt::Display for LogEntry<I> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (s, fraction) = (self.at_us / 1_000_000, self.at_us % 1_000_000);
        write!(f, "({s:010}.{fraction:06}) {} {}", self.interface, self.frame)
    }
}

/// Writes a log, a line for each entry.
pub fn write<I: fmt::Display>(entries: &[LogEntry<I>], mut to: impl io::Write) -> io::Result<()> {
    entries.iter().try_for_each(|entry| writeln!(to, "{entry}"))
}

/// A line that is not in candump's log format.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("line {line}: {what} in `{text}`; expected `(seconds.micros) interface id#data`")]
pub struct ParseError {
    /// Counted from 1.
    pub line: usize,
    /// What is wrong.
    pub what: String,
    /// The line.
    pub text: String,
}

/// Reads the data frames of a log. Empty lines, remote frames and reports of errors are skipped.
pub fn parse<I: FromStr<Err: fmt::Display>>(text: &str) -> Result<Vec<LogEntry<I>>, ParseError> {
    let lines = text.lines().enumerate().filter(|(_, text)| !text.trim().is_empty());
    let entries = lines.map(|(index, text)| {
        parse_line(text).map_err(|what| ParseError { line: index + 1, what, text: text.to_owned() })
    });
    entries.filter_map(Result::transpose).collect()
}

fn parse_line<I: FromStr<Err: fmt::Display>>(text: &str) -> Result<Option<LogEntry<I>>, String> {
    let mut fields = text.split_whitespace();
    let at_us = fields
        .next()
        .and_then(|field| field.strip_prefix('(')?.strip_suffix(')')?.split_once('.'))
        .filter(|(_, micros)| micros.len() == 6)
        .and_then(|(s, us)| {
            let (s, us): (u64, u64) = (s.parse().ok()?, us.parse().ok()?);
            s.checked_mul(1_000_000)?.checked_add(us)
        })
        .ok_or("no time")?;
    let interface = fields.next().ok_or("no interface")?;
    let interface = interface.parse().map_err(|error: I::Err| error.to_string())?;
    let (digits, data) = fields.next().and_then(|field| field.split_once('#')).ok_or("no frame")?;
    if !matches!(digits.len(), 3 | 8) {
        return Err("an id that has neither 3 nor 8 hexadecimal digits".into());
    }
    let id = u32::from_str_radix(digits, 16).map_err(|_| "an id that is not hexadecimal")?;
    if id & ERROR_FLAG != 0 || data.starts_with('R') {
        return Ok(None);
    }
    let data = parse_bytes(data).ok_or("data that is not pairs of hexadecimal digits")?;
    let frame = if digits.len() == 3 {
        Frame::standard(id as u16, &data)
    } else {
        Frame::extended(id, &data)
    };
    let frame = frame.ok_or("an id above 7FF or 1FFFFFFF or more than 8 data bytes")?;
    Ok(Some(LogEntry { at_us, interface, frame }))
}

fn parse_bytes(hex: &str) -> Option<Vec<u8>> {
    if !hex.bytes().all(|digit| digit.is_ascii_hexdigit()) || !hex.len().is_multiple_of(2) {
        return None;
    }
    (0..hex.len()).step_by(2).map(|k| u8::from_str_radix(&hex[k..k + 2], 16).ok()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn text_of(entries: &[LogEntry]) -> String {
        let mut bytes = Vec::new();
        write(entries, &mut bytes).unwrap();
        String::from_utf8(bytes).unwrap()
    }

    #[test]
    fn prints_what_candump_prints() {
        let entry = LogEntry {
            at_us: 1_700_000_000_123_456,
            interface: "can0",
            frame: Frame::standard(0x123, &[0xDE, 0xAD, 0xBE, 0xEF]).unwrap(),
        };
        assert_eq!(entry.to_string(), "(1700000000.123456) can0 123#DEADBEEF");
        let extended = Frame::extended(0x123, &[1]).unwrap();
        let entry = LogEntry { frame: extended, ..entry };
        assert_eq!(entry.to_string(), "(1700000000.123456) can0 00000123#01");
        let frame = Frame::standard(0x0F0, &[]).unwrap();
        let stop = LogEntry { at_us: 1234, interface: "link0".into(), frame };
        assert_eq!(text_of(&[stop]), "(0000000000.001234) link0 0F0#\n");
    }

    #[test]
    fn a_broken_line_is_named() {
        for (line, what) in [
            ("(1.5) act0 123#00", "no time"),
            ("(1.000005)", "no interface"),
            ("(1.000005) act0 123", "no frame"),
            ("(1.000005) act0 1234#00", "an id that has neither 3 nor 8 hexadecimal digits"),
            ("(1.000005) act0 12G#00", "an id that is not hexadecimal"),
            ("(1.000005) act0 123#0", "data that is not pairs of hexadecimal digits"),
            ("(1.000005) act0 123##100", "data that is not pairs of hexadecimal digits"),
            ("(1.000005) act0 800#", "an id above 7FF or 1FFFFFFF or more than 8 data bytes"),
            (
                "(1.000005) act0 123#000000000000000000",
                "an id above 7FF or 1FFFFFFF or more than 8 data bytes",
            ),
        ] {
            let error =
                parse::<String>(&format!("(1.000005) act0 123#00\n\n{line}\n")).unwrap_err();
            assert_eq!((error.line, error.what.as_str()), (3, what));
            assert!(error.to_string().contains(line), "{error}");
        }
    }

    #[test]
    fn what_carries_no_data_is_skipped() {
        let text = "(1.000005) can0 123#R\n(1.000006) can0 20000004#0004000000000000\n\
                    (1.000007) can0 123#R8\n(1.000008) can0 123#00\n";
        let entries = parse::<String>(text).unwrap();
        assert_eq!(entries.iter().map(|entry| entry.at_us).collect::<Vec<_>>(), [1_000_008]);
    }

    fn frame() -> impl Strategy<Value = Frame> {
        let data = || prop::collection::vec(any::<u8>(), 0..=8);
        prop_oneof![
            (0u16..0x800, data()).prop_map(|(id, d)| Frame::standard(id, &d).unwrap()),
            (0u32..1 << 29, data()).prop_map(|(id, d)| Frame::extended(id, &d).unwrap()),
        ]
    }

    proptest! {
        #[test]
        fn what_is_written_is_read_back(
            rows in prop::collection::vec((0u64..1 << 50, frame(), "[a-z0-9]{1,8}"), 0..20)
        ) {
            let entries: Vec<_> = rows
                .into_iter()
                .map(|(at_us, frame, interface)| LogEntry { at_us, interface, frame })
                .collect();
            prop_assert_eq!(parse(&text_of(&entries)).unwrap(), entries);
        }

        #[test]
        fn no_text_makes_the_parser_panic(text in "\\PC{0,60}") {
            let _ = parse::<String>(&text);
        }
    }
}
