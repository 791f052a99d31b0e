//! Names that robot files allow, from those of a URDF: letters, digits, `_` and `-`, 32 at most, each once.

use super::notes::Notes;
use crate::document::Span;
use rollwalk_protocol::library::MAX_NAME;
use std::collections::HashSet;

/// Names in use for one kind of item.
#[derive(Debug, Default)]
pub(super) struct Names {
    taken: HashSet<String>,
}

/// Name without forbidden letters, of the allowed length.
pub(super) fn allowed(written: &str) -> String {
    let fits = |c: char| c.is_ascii_alphanumeric() || c == '_' || c == '-';
    let fitting = written.chars().map(|c| if fits(c) { c } else { '_' });
    let name: String = fitting.take(MAX_NAME).collect();
    if name.is_empty() { "unnamed".to_owned() } else { name }
}

impl Names {
    /// Returns an allowed name for `written`, and warns of a change.
    pub fn give(
        &mut self,
        kind: &str,
        written: &str,
        span: &Span,
        notes: &mut Notes<'_>,
    ) -> String {
        let name = self.unique(&allowed(written));
        if name != written {
            let why = format!(
                "give each item its own name of 1 to {MAX_NAME} letters, digits, `_` or `-`"
            );
            notes.warn(span, format_args!("{kind} `{written}` is imported as `{name}`: {why}"));
        }
        name
    }

    /// Name with a number if it is in use already.
    pub fn unique(&mut self, name: &str) -> String {
        let mut candidate = name.to_owned();
        let mut number = 1;
        while !self.taken.insert(candidate.clone()) {
            number += 1;
            let suffix = format!("_{number}");
            let kept = name.len().min(MAX_NAME - suffix.len());
            candidate = format!("{}{suffix}", &name[..kept]);
        }
        candidate
    }
}

/// List of the first names and the number of the others.
pub(super) fn some_names<'n>(names: impl ExactSizeIterator<Item = &'n String>) -> String {
    let count = names.len();
    let mut shown = names.take(4).map(|name| format!("`{name}`")).collect::<Vec<_>>().join(", ");
    if count > 4 {
        shown += &format!(" and {} more", count - 4);
    }
    shown
}
