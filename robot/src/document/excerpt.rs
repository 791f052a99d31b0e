//! Excerpts of a text for reports: lines with faults, safe for terminals, with long lines shortened.

use super::{Fault, Span};
use rollwalk_protocol::text::is_hidden;

/// Maximum length of a line in a report, bytes.
const LINE_MAX: usize = 200;
/// Maximum initial capacity of an excerpt, bytes.
const SHORT_MAX: usize = 1 << 16;
/// Length of the text before a fault in a shortened line, bytes.
const BEFORE: usize = 60;

/// Converts the text for a report, and stores the position of each fault in it. Faults must be in the order of the text.
pub(super) fn excerpt(text: &str, faults: &mut [Fault]) -> String {
    let mut shown = String::with_capacity(text.len().min(SHORT_MAX));
    let (mut at, mut done) = (0, 0);
    for line in text.split_inclusive('\n') {
        let span = at..at + line.len();
        at = span.end;
        let of_line = faults[done..].iter().take_while(|fault| fault.span.start < at).count();
        let inside = &mut faults[done..done + of_line];
        done += of_line;
        if line.len() <= LINE_MAX {
            for fault in inside {
                fault.shown = moved(&fault.span, span.start, shown.len());
            }
            show(line, &mut shown);
            continue;
        }
        // The excerpt is around the first fault; other faults of the line are shown at its end.
        let first = inside.iter().map(|fault| fault.span.start - span.start).min().unwrap_or(0);
        let from = line.floor_char_boundary(first.saturating_sub(BEFORE));
        let to = line.floor_char_boundary((from + LINE_MAX).min(line.trim_end().len()));
        let start = shown.len();
        shown.push_str(if from > 0 { "…" } else { "" });
        let window = shown.len();
        show(&line[from..to], &mut shown);
        let end = shown.len();
        shown.push_str(if to < line.trim_end().len() { "…" } else { "" });
        shown.push_str(if line.ends_with('\n') { "\n" } else { "" });
        for fault in inside {
            let Span { start: a, end: b } = moved(&fault.span, span.start + from, window);
            fault.shown = a.clamp(start, end)..b.clamp(start, end);
        }
    }
    // At the end, where a key is missing.
    for fault in &mut faults[done..] {
        fault.shown = shown.len()..shown.len();
    }
    shown
}

/// Appends a text with unsafe characters replaced.
fn show(text: &str, shown: &mut String) {
    if text.bytes().all(|byte| matches!(byte, b' '..=b'~' | b'\n' | b'\t' | b'\r')) {
        shown.push_str(text);
    } else {
        shown.extend(text.chars().flat_map(visible));
    }
}

/// Shifts a span from one start to another.
fn moved(span: &Span, from: usize, to: usize) -> Span {
    let at = |byte: usize| (byte + to).saturating_sub(from);
    at(span.start)..at(span.end)
}

/// Returns the character, or one question mark for each byte of a character that is unsafe to print, so that spans stay valid.
fn visible(c: char) -> impl Iterator<Item = char> {
    let (shown, times) = match c.len_utf8() {
        _ if !is_hidden(c) || matches!(c, '\n' | '\t' | '\r') => (c, 1),
        bytes => ('?', bytes),
    };
    std::iter::repeat_n(shown, times)
}

#[cfg(test)]
mod tests {
    fn shown(text: &str, at: &str) -> (String, String) {
        let start = text.find(at).unwrap();
        let mut faults = [super::Fault::new(text, start..start + at.len(), "m", "l", "h")];
        let shown = super::excerpt(text, &mut faults);
        let span = faults[0].shown.clone();
        let marked = shown[span].to_owned();
        (shown, marked)
    }

    #[test]
    fn spans_stay_on_what_they_mark() {
        let (text, marked) = shown("a = 1\nb\u{9b}\u{202e}ü = wrong\nc = 3", "wrong");
        assert_eq!((&*text, &*marked), ("a = 1\nb?????ü = wrong\nc = 3", "wrong"));
    }

    #[test]
    fn long_lines_are_cut_around_the_fault() {
        let long =
            format!("a = 1\nx = [{}, wrong, {}]\nc = 3", "1, ".repeat(5000), "2, ".repeat(5000));
        let (text, marked) = shown(&long, "wrong");
        assert_eq!(marked, "wrong");
        assert!(text.len() < 250 && text.lines().count() == 3, "{text}");
        assert!(text.starts_with("a = 1\n…") && text.ends_with("…\nc = 3"), "{text}");
        let end = &mut [super::Fault::new(&long, long.len()..long.len(), "m", "l", "h")];
        assert_eq!(super::excerpt(&long, end).len(), end[0].shown.start);
        // A fault that is longer than the maximum line.
        let long = format!("x = \"{}\"\nc = 3", "ü".repeat(5000));
        let (text, marked) = shown(&long, &format!("\"{}\"", "ü".repeat(5000)));
        assert!(text.len() < 250 && marked.starts_with("\"ü"), "{text}");
    }
}
