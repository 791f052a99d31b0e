//! Logs in the format of `candump -l` (can-utils), which `canplayer`, `cantools` and Wireshark read.
//!
//! Each line is a frame: `(1700000000.123456) can0 123#DEADBEEF`. Identifiers of 29 bits have eight digits. The time is in
//! seconds since 1970, or since the start of a simulation.

use rollwalk_protocol::can::Frame;
use rollwalk_protocol::text::Excerpt;
use std::fmt;
use std::io;
use std::str::FromStr;

/// Identifier bit of an error report by the interface, which is not a frame.
const ERROR_FLAG: u32 = 0x2000_0000;

/// Inverse fraction of out-of-order entries. If more than one of this many entries is earlier than its predecessor, the times
/// of the log are differences.
const BACK_SHARE: usize = 8;
/// Minimum number of entries for detecting times that are differences.
const DIFFERENCES_MIN: usize = 30;

/// Frame on an interface at a time, which is displayed as a line of the log.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct LogEntry<I = String> {
    /// Time at which the frame ended, µs.
    pub at_us: u64,
    /// Name of the bus, without spaces.
    pub interface: I,
    /// Content of the frame.
    pub frame: Frame,
}

impl<I: fmt::Display> fmt::Display for LogEntry<I> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (s, fraction) = (self.at_us / 1_000_000, self.at_us % 1_000_000);
        write!(f, "({s:010}.{fraction:06}) {} {}", self.interface, self.frame)
    }
}

/// Writes a log, one line for each entry.
pub fn write<I: fmt::Display>(entries: &[LogEntry<I>], mut to: impl io::Write) -> io::Result<()> {
    entries.iter().try_for_each(|entry| writeln!(to, "{entry}"))
}

/// Line that is not in candump's log format.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error(
    "line {line}: {what} in `{}`; expected `(seconds.micros) interface id#data`, as printed by \
     `candump -L`",
    Excerpt::start_of(text)
)]
pub struct ParseError {
    /// Line number, counted from 1.
    pub line: usize,
    /// Description of the defect.
    pub what: String,
    /// Text of the line.
    pub text: String,
}

/// Content of a log.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Log<I = String> {
    /// Data frames of the log.
    pub entries: Vec<LogEntry<I>>,
    /// Number of omitted frames of CAN FD and CAN XL.
    pub foreign: usize,
    /// Final line, if it is invalid and has no line end, because the log was truncated.
    pub cut: Option<ParseError>,
}

/// Reads the data frames of a log like [`read`].
///
/// # Errors
/// Returns the errors of [`read`].
pub fn parse<I: FromStr<Err: fmt::Display>>(text: &str) -> Result<Vec<LogEntry<I>>, ParseError> {
    read(text).map(|log| log.entries)
}

/// Reads the data frames of a log.
///
/// Skips empty lines, remote frames and error reports. Counts frames of CAN FD and CAN XL. Stores a truncated final line in
/// [`Log::cut`].
///
/// # Errors
/// Returns an error for the first other line that is not in the format of a log, or if the times are differences.
pub fn read<I: FromStr<Err: fmt::Display>>(text: &str) -> Result<Log<I>, ParseError> {
    let mut log = Log { entries: Vec::new(), foreign: 0, cut: None };
    let mut back = Vec::new();
    let lines = text.split_inclusive('\n').enumerate();
    for (index, line) in lines.filter(|(_, line)| !line.trim().is_empty()) {
        let text = line.trim_end_matches(['\r', '\n']);
        let error = |what: String| ParseError { line: index + 1, what, text: text.to_owned() };
        match parse_line::<I>(text) {
            Ok(Line::Frame(entry)) => {
                if log.entries.last().is_some_and(|last| entry.at_us < last.at_us) {
                    back.push(index);
                }
                log.entries.push(entry);
            }
            Ok(Line::Foreign) => log.foreign += 1,
            Ok(Line::NoData) => {}
            Err(what) if !line.ends_with('\n') && !log.entries.is_empty() => {
                log.cut = Some(error(what));
            }
            Err(what) => return Err(error(what)),
        }
    }
    // Entries of several interfaces may be out of order by microseconds.
    let count = log.entries.len();
    let is_back = count >= DIFFERENCES_MIN && back.len() * BACK_SHARE > count;
    if let Some(&index) = back.first().filter(|_| is_back) {
        let what = "times that decrease, as printed by `candump -td`,";
        let text = text.lines().nth(index).unwrap_or_default().to_owned();
        return Err(ParseError { line: index + 1, what: what.into(), text });
    }
    Ok(log)
}

/// True if the first line of a text has one of candump's formats, including those without times.
pub fn is_of_candump(text: &str) -> bool {
    let first = text.lines().find(|line| !line.trim().is_empty()).unwrap_or_default();
    first.trim_start().starts_with('(') || is_view(&mut first.split_whitespace())
}

/// True for fields such as `can0 123 [2] 11 22`, the format of candump without `-L`. The length of a CAN FD frame has two
/// digits.
fn is_view<'t>(fields: &mut impl Iterator<Item = &'t str>) -> bool {
    let (_, id, length) = (fields.next(), fields.next(), fields.next());
    let is_hex = |id: &str| id.bytes().all(|digit| digit.is_ascii_hexdigit());
    let is_length = |of: &str| {
        let of = of.strip_prefix('[').and_then(|of| of.strip_suffix(']'));
        of.is_some_and(|of| of.parse::<u16>().is_ok())
    };
    id.is_some_and(is_hex) && length.is_some_and(is_length)
}

/// Content of a line.
enum Line<I> {
    Frame(LogEntry<I>),
    /// Frame of CAN FD or CAN XL.
    Foreign,
    /// Remote frame or error report.
    NoData,
}

fn parse_line<I: FromStr<Err: fmt::Display>>(text: &str) -> Result<Line<I>, String> {
    let has_time = text.trim_start().starts_with('(');
    // The time of `-tA` contains a space.
    let (time, rest) =
        if has_time { text.split_once(')').unwrap_or((text, "")) } else { ("", text) };
    if is_view(&mut rest.split_whitespace()) {
        return Err("candump's view format".into());
    }
    let at_us = time
        .trim_start()
        .strip_prefix('(')
        .and_then(|time| time.split_once('.'))
        .filter(|(_, micros)| micros.len() == 6)
        .and_then(|(s, us)| {
            let (s, us): (u64, u64) = (s.parse().ok()?, us.parse().ok()?);
            s.checked_mul(1_000_000)?.checked_add(us)
        })
        .ok_or("no time")?;
    let mut fields = rest.split_whitespace();
    let interface = fields.next().ok_or("no interface")?;
    let interface = interface.parse().map_err(|error: I::Err| error.to_string())?;
    let (digits, data) = fields.next().and_then(|field| field.split_once('#')).ok_or("no frame")?;
    if !matches!(digits.len(), 3 | 8) {
        return Err("an id without 3 or 8 hexadecimal digits".into());
    }
    let id = u32::from_str_radix(digits, 16).map_err(|_| "an id that is not hexadecimal")?;
    // `##` and flags of CAN FD; priority, type and fields of CAN XL with colons.
    if data.starts_with('#') || data.contains(':') {
        return Ok(Line::Foreign);
    }
    if id & ERROR_FLAG != 0 || data.starts_with('R') {
        return Ok(Line::NoData);
    }
    // A length code of 9 to F also means 8 bytes.
    let data = data.split_once('_').map_or(data, |(data, _)| data);
    let data = parse_bytes(data).ok_or("data that is not pairs of hexadecimal digits")?;
    let frame = if digits.len() == 3 {
        Frame::standard(id as u16, &data)
    } else {
        Frame::extended(id, &data)
    };
    let frame = frame.ok_or("an id above 7FF or 1FFFFFFF or more than 8 data bytes")?;
    Ok(Line::Frame(LogEntry { at_us, interface, frame }))
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
            ("(1.000005) act0 1234#00", "an id without 3 or 8 hexadecimal digits"),
            ("(1.000005) act0 12G#00", "an id that is not hexadecimal"),
            ("(1.000005) act0 123#0", "data that is not pairs of hexadecimal digits"),
            ("(1.000005) act0 123#0X", "data that is not pairs of hexadecimal digits"),
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

    #[test]
    fn frames_of_others_and_a_cut_line_do_not_spoil_a_log() {
        let ours = "(1.000005) can0 123#00\n(1.000006) can0 00000123#01\n";
        let foreign = "(1.000007) can0 123##100112233445566778899AABB\n\
                       (1.000008) can0 00000123##5\n\
                       (1.000009) can0 123#80:00:00000000#1122334455\n";
        let log = read::<String>(&format!("{foreign}{ours}{foreign}")).unwrap();
        assert_eq!((log.entries.len(), log.foreign, log.cut), (2, 6, None));
        let whole = format!("{ours}(1.000010) can0 124#0102030405060708");
        for length in ours.len()..=whole.len() {
            let log = read::<String>(&whole[..length]).unwrap();
            let last = log.entries.get(2);
            assert_eq!(
                log.entries.len() - 2 + usize::from(log.cut.is_some()),
                usize::from(length > ours.len())
            );
            assert!(last.is_none_or(|entry| entry.at_us == 1_000_010), "{last:?}");
            assert!(log.cut.is_none_or(|cut| cut.line == 3));
        }
        // A cut line counts as an error if other lines follow, or if it is the only one.
        assert_eq!(read::<String>(&format!("(1.000\n{ours}")).unwrap_err().line, 1);
        assert!(read::<String>("(1.000").is_err());
        // Raw length codes and the end of a line of other systems.
        let log = read::<String>("(1.000005) can0 123#0102030405060708_9\r\n").unwrap();
        assert_eq!(log.entries[0].frame.data().len(), 8);
    }

    #[test]
    fn other_formats_of_candump_are_refused_by_name() {
        for line in [
            "  can0  123   [8]  11 22 33 44 55 66 77 88",
            "  vcan0  123   [0] ",
            "  can0  00000123  [12]  11 22 33 44 55 66 77 88 99 AA BB CC",
            " (1700000000.123456)  can0  123   [2]  11 22",
            " (000.010123)  can0  123   [2]  11 22",
            " (2026-11-29 19:00:00.123456)  can0  123   [2]  11 22",
            "  can0  TX - -  123   [2]  11 22",
        ] {
            assert!(is_of_candump(line) || line.contains("TX"), "{line}");
            let error = read::<String>(&format!("{line}\n{line}\n")).unwrap_err().to_string();
            let what = if line.contains("TX") { "no time" } else { "view format" };
            assert!(error.contains(what) && error.contains("candump -L"), "{error}");
        }
        let deltas: String = (0..100)
            .map(|k| format!("(000.{:06}) can0 123#00\n", if k % 2 == 0 { 9_990 } else { 10_010 }))
            .collect();
        let error = read::<String>(&deltas).unwrap_err();
        assert_eq!(error.line, 3);
        assert!(error.to_string().contains("candump -td"), "{error}");
        // Two interfaces may be out of order.
        let times = [1, 2, 4, 3, 5, 6, 7, 8, 9, 10];
        let log: String = times.iter().map(|us| format!("(1.{us:06}) can0 123#00\n")).collect();
        assert_eq!(read::<String>(&log).unwrap().entries.len(), 10);
        assert!(!is_of_candump("time_s,motion\n1,2\n") && !is_of_candump(""));
    }

    #[test]
    fn a_long_line_is_quoted_in_part() {
        let line = format!("(1.000005) can0 123\u{1b}[2J{}\n", "x".repeat(10 << 20));
        let error = read::<String>(&line).unwrap_err().to_string();
        assert!(error.len() < 400 && error.contains("\\u001b[2Jxx"), "{error}");
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
