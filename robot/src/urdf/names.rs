//! Names of a URDF to names that robot files allow: letters, digits, `_` and `-`, 32 at most, each once.

use super::notes::Notes;
use crate::document::Span;
use rollwalk_protocol::library::MAX_NAME;
use std::collections::HashSet;

/// Names of one kind of item that are in use.
#[derive(Debug, Default)]
pub(super) struct Names {
    taken: HashSet<String>,
}

/// `written` without forbidden letters, not too long.
pub(super) fn allowed(written: &str) -> String {
    let fits = |c: char| c.is_ascii_alphanumeric() || c == '_' || c == '-';
    let fitting = written.chars().map(|c| if fits(c) { c } else { '_' });
    let name: String = fitting.take(MAX_NAME).collect();
    if name.is_empty() { "unnamed".to_owned() } else { name }
}

impl Names {
    /// An allowed name for `written`; warns of a change.
    pub fn give(
        &mut self,
        kind: &str,
        written: &str,
        span: &Span,
        notes: &mut Notes<'_>,
    ) -> String {
        let name = self.unique(&allowed(written));
        if name != written {
            let why = format!("names have 1 to {MAX_NAME} letters, digits, `_` or `-`, each once");
            notes.warn(span, format_args!("{kind} `{written}` is called `{name}`: {why}"));
        }
        name
    }

    /// `name`, numbered if it is taken.
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

/// A few names and how many more there are.
pub(super) fn some_names<'n>(names: impl ExactSizeIterator<Item = &'n String>) -> String {
    let count = names.len();
    let mut shown = names.take(4).map(|name| format!("`{name}`")).collect::<Vec<_>>().join(", ");
    if count > 4 {
        shown += &format!(" and {} more", count - 4);
    }
    shown
}
