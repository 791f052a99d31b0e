//! Logs in the format of `candump -l` (can-utils), which `canplayer`, `cantools` and Wireshark read.
//!
//! One line a frame: `(1700000000.123456) can0 123#DEADBEEF`, here with virtual time since the start
//! of the simulation: `(0000000000.001234) link0 0F0#`. Interfaces are `link0` (host and controller)
//! and `act0`, `act1`, ... (controller and actuators).

use crate::clock::SimTime;
use rollwalk_protocol::can::CanFrame;
use std::fmt;
use std::io;
use std::str::FromStr;

/// A bus of the simulation.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Interface {
    /// `link0`: host and controller.
    Link,
    /// `act0`, `act1`, ...: controller and actuators.
    Actuator(u8),
}

impl fmt::Display for Interface {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Link => write!(f, "link0"),
            Self::Actuator(bus) => write!(f, "act{bus}"),
        }
    }
}

impl FromStr for Interface {
    type Err = &'static str;
    fn from_str(name: &str) -> Result<Self, Self::Err> {
        let actuator = || name.strip_prefix("act")?.parse().ok().map(Self::Actuator);
        if name == "link0" { Some(Self::Link) } else { actuator() }
            .ok_or("an interface that is not link0, act0, act1, ...")
    }
}

/// A frame on an interface at an instant; prints as a line of the log.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct LogEntry {
    /// End of the frame. The log holds microseconds, rounded down.
    pub at: SimTime,
    /// The bus.
    pub interface: Interface,
    /// The frame.
    pub frame: CanFrame,
}

impl fmt::Display for LogEntry {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let us = self.at.as_us();
        let (s, fraction) = (us / 1_000_000, us % 1_000_000);
        write!(f, "({s:010}.{fraction:06}) {} {:03X}#", self.interface, self.frame.id())?;
        self.frame.data().iter().try_for_each(|byte| write!(f, "{byte:02X}"))
    }
}

/// Writes a log, a line for each entry.
pub fn write(entries: &[LogEntry], mut to: impl io::Write) -> io::Result<()> {
    entries.iter().try_for_each(|entry| writeln!(to, "{entry}"))
}

/// A line that is not in candump's log format.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("line {line}: {what} in `{text}`; expected `(seconds.micros) interface id#data`")]
pub struct ParseError {
    /// Counted from 1.
    pub line: usize,
    /// What is wrong.
    pub what: &'static str,
    /// The line.
    pub text: String,
}

/// Reads a log of data frames with 11-bit ids; empty lines are skipped.
pub fn parse(text: &str) -> Result<Vec<LogEntry>, ParseError> {
    let lines = text.lines().enumerate().filter(|(_, text)| !text.trim().is_empty());
    lines
        .map(|(index, text)| {
            parse_line(text).map_err(|what| ParseError {
                line: index + 1,
                what,
                text: text.to_owned(),
            })
        })
        .collect()
}

fn parse_line(text: &str) -> Result<LogEntry, &'static str> {
    let mut fields = text.split_whitespace();
    let at = fields
        .next()
        .and_then(|field| field.strip_prefix('(')?.strip_suffix(')')?.split_once('.'))
        .filter(|(_, micros)| micros.len() == 6)
        .and_then(|(s, us)| {
            let (s, us): (u64, u64) = (s.parse().ok()?, us.parse().ok()?);
            s.checked_mul(1_000_000)?.checked_add(us)?.checked_mul(1_000).map(SimTime::from_ns)
        })
        .ok_or("no time")?;
    let interface = fields.next().ok_or("no interface")?.parse()?;
    let (id, data) = fields.next().and_then(|field| field.split_once('#')).ok_or("no frame")?;
    if id.len() != 3 {
        return Err("an id that does not have 3 hexadecimal digits");
    }
    let id = u16::from_str_radix(id, 16).map_err(|_| "an id that is not hexadecimal")?;
    let data = parse_bytes(data).ok_or("data that is not pairs of hexadecimal digits")?;
    let frame = CanFrame::new(id, &data).ok_or("an id above 7FF or more than 8 data bytes")?;
    Ok(LogEntry { at, interface, frame })
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
            at: SimTime::from_ns(1_700_000_000_123_456_999),
            interface: Interface::Actuator(0),
            frame: CanFrame::new(0x123, &[0xDE, 0xAD, 0xBE, 0xEF]).unwrap(),
        };
        assert_eq!(entry.to_string(), "(1700000000.123456) act0 123#DEADBEEF");
        let stop = LogEntry {
            at: SimTime::from_us(1234),
            interface: Interface::Link,
            frame: CanFrame::new(0x0F0, &[]).unwrap(),
        };
        assert_eq!(text_of(&[stop]), "(0000000000.001234) link0 0F0#\n");
    }

    #[test]
    fn a_broken_line_is_named() {
        for (line, what) in [
            ("(1.5) act0 123#00", "no time"),
            ("(1.000005)", "no interface"),
            ("(1.000005) can7 123#00", "an interface that is not link0, act0, act1, ..."),
            ("(1.000005) act0 123", "no frame"),
            ("(1.000005) act0 12345678#00", "an id that does not have 3 hexadecimal digits"),
            ("(1.000005) act0 123#0", "data that is not pairs of hexadecimal digits"),
            ("(1.000005) act0 123#R", "data that is not pairs of hexadecimal digits"),
            ("(1.000005) act0 800#", "an id above 7FF or more than 8 data bytes"),
            ("(1.000005) act0 123#000000000000000000", "an id above 7FF or more than 8 data bytes"),
        ] {
            let error = parse(&format!("(1.000005) act0 123#00\n\n{line}\n")).unwrap_err();
            assert_eq!((error.line, error.what), (3, what));
            assert!(error.to_string().contains(line), "{error}");
        }
    }

    proptest! {
        #[test]
        fn what_is_written_is_read_back(
            rows in prop::collection::vec(
                (0u64..1 << 50, 0u16..0x800, prop::collection::vec(any::<u8>(), 0..=8), 0u8..4),
                0..20,
            )
        ) {
            let entries: Vec<_> = rows
                .into_iter()
                .map(|(us, id, data, bus)| LogEntry {
                    at: SimTime::from_us(us),
                    interface: if bus == 3 { Interface::Link } else { Interface::Actuator(bus) },
                    frame: CanFrame::new(id, &data).unwrap(),
                })
                .collect();
            prop_assert_eq!(parse(&text_of(&entries)).unwrap(), entries);
        }

        #[test]
        fn no_text_makes_the_parser_panic(text in "\\PC{0,60}") {
            let _ = parse(&text);
        }
    }
}
