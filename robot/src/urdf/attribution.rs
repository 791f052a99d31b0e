//! Sources of faults in an imported robot file: the line of the URDF or of the side file that has the faulty value.

use super::draft::Origin;
use super::emit::Emitted;
use super::notes::Notes;
use crate::document::{Document, DocumentError, Span};

/// Attributes faults of the robot file to their sources in URDF and side file.
pub(super) fn attribute(
    error: &DocumentError,
    emitted: &Emitted,
    notes: &mut Notes<'_>,
    side: &Document<'_>,
) {
    for fault in error.faults() {
        let holds =
            |(part, _): &&(std::ops::Range<usize>, Origin)| part.contains(&fault.span.start);
        let fault = fault.clone();
        match emitted.origins.iter().find(holds) {
            Some((_, Origin::Urdf(span))) => {
                notes.fault(span.clone(), fault.message, "comes from here", fault.help);
            }
            Some((_, Origin::Side(span))) => {
                let key = key_at(&emitted.text, fault.span.start);
                let value = key.and_then(|key| value_of(side.text(), span, key));
                let span = value.unwrap_or_else(|| span.clone());
                side.fault(span, fault.message, "comes from here", fault.help);
            }
            // Actuators and whole-robot values are corrected in the side file.
            None => side.fault(0..0, fault.message, "in the imported robot", fault.help),
        }
    }
}

/// Key of the line of a robot file with a value at `byte`.
fn key_at(text: &str, byte: usize) -> Option<&str> {
    let start = text[..byte].rfind('\n').map_or(0, |end| end + 1);
    let (key, _) = text[start..].lines().next()?.split_once('=')?;
    Some(key.trim())
}

/// Span of a key's value in the table of a side file at `table`: the rest of an inline table, or the lines up to the next header.
fn value_of(text: &str, table: &Span, key: &str) -> Option<Span> {
    let rest = &text[table.end..];
    let line = rest.find('\n').unwrap_or(rest.len());
    let is_inline = rest[..line].contains('{');
    let end = if is_inline { line } else { rest.find("\n[").unwrap_or(rest.len()) };
    let is_comment = |at: usize| rest[..at].rsplit('\n').next().is_some_and(|of| of.contains('#'));
    let is_start = |at: usize| rest[..at].ends_with(['\n', ' ', '\t', ',', '{']) && !is_comment(at);
    let found = rest[..end].match_indices(key).filter(|(at, _)| is_start(*at));
    found.filter_map(|(at, _)| rest[at + key.len()..end].trim_start().strip_prefix('=')).next().map(
        |value| {
            let value = value.trim_start();
            let start = table.end + end - value.len();
            let stops = if is_inline { &[',', '}', '#'][..] } else { &['\n', '#'] };
            let length = value.find(stops).unwrap_or(value.len());
            start..start + value[..length].trim_end().len()
        },
    )
}

#[cfg(test)]
mod tests {
    use super::value_of;

    #[test]
    fn values_are_found_in_their_table() {
        let text = "[joint]\nhip = { nominal_rad = 0.7, bus = 1 } # bus = 2\n\n[[end_effector]]\nname = \"a\"\n# radius_m = 2\nradius_m = 20.0 # m\n\n[[end_effector]]\nradius_m = 3\n";
        let of = |table: &str, key| {
            let start = text.find(table).unwrap();
            value_of(text, &(start..start + table.len()), key).map(|span| &text[span])
        };
        assert_eq!(of("hip", "nominal_rad"), Some("0.7"));
        assert_eq!(of("hip", "bus"), Some("1"));
        assert_eq!(of("[[end_effector]]", "radius_m"), Some("20.0"));
        assert_eq!(of("[[end_effector]]", "friction"), None);
        assert_eq!(of("hip", "radius_m"), None);
    }
}
