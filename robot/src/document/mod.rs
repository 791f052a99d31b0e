//! TOML text with spans, and faults that refer to these spans.
//!
//! Readers of robot, motion and library files share this module. Each of their faults has file, line, field and a remedy. The
//! module does not access the file system: the caller supplies name and text.
//!
//! Readers collect faults instead of stopping at the first one. A getter of [`Table`] that finds a wrong value records a
//! [`Fault`] and returns `None`. [`Document::finish`] then returns the value, or all faults in file order. [`Table::done`]
//! rejects unread keys.

mod excerpt;
mod suggest;
mod table;

pub use rollwalk_protocol::text::Excerpt;
pub use suggest::{alternatives, in_other_unit};
pub use table::{NAME_MAX, NamedNumber, NamedString, Table};

use miette::{Diagnostic, LabeledSpan, NamedSource, SourceCode};
use std::cell::RefCell;
use std::fmt;
use std::ops::Range;
use toml::Spanned;
use toml::de::DeTable;

/// Byte range in the text of a document.
pub type Span = Range<usize>;

/// Maximum number of syntax faults in a report. A text in another format has one on every line.
const SYNTAX_FAULTS_MAX: usize = 3;
/// Maximum number of faults in a report.
pub(crate) const FAULTS_MAX: usize = 20;
/// Maximum length of a message, a label or a help line, characters. They quote parts of the file.
const WORDS_MAX: usize = 1000;

/// Fault in a document.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Fault {
    /// Message with the names of item and field.
    pub message: String,
    /// Short note at the faulty text.
    pub label: String,
    /// Span of the faulty text.
    pub span: Span,
    /// Line number of the span's start, from 1.
    pub line: usize,
    /// Correct value, or a remedy.
    pub help: String,
    /// Span in the excerpt of a report.
    shown: Span,
}

impl Fault {
    /// Creates a fault at `span` of `text`.
    pub(crate) fn new(
        text: &str,
        span: Span,
        message: impl Into<String>,
        label: impl Into<String>,
        help: impl Into<String>,
    ) -> Self {
        let line = line_at(text, span.start);
        let [message, label, help] = [message.into(), label.into(), help.into()].map(cut);
        let shown = span.clone();
        Self { message, label, span, line, help, shown }
    }
}

/// Shortens a text to the maximum length in reports.
fn cut(mut text: String) -> String {
    if let Some((at, _)) = text.char_indices().nth(WORDS_MAX) {
        text.truncate(at);
        text.push('…');
    }
    text
}

/// Line number of a byte position in a text, from 1.
pub(crate) fn line_at(text: &str, byte: usize) -> usize {
    1 + text.as_bytes().iter().take(byte).filter(|&&b| b == b'\n').count()
}

impl fmt::Display for Fault {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.message)
    }
}

impl std::error::Error for Fault {}

impl Diagnostic for Fault {
    fn help<'a>(&'a self) -> Option<Box<dyn fmt::Display + 'a>> {
        Some(Box::new(&self.help))
    }

    fn labels(&self) -> Option<Box<dyn Iterator<Item = LabeledSpan> + '_>> {
        let label = LabeledSpan::new_with_span(Some(self.label.clone()), self.shown.clone());
        Some(Box::new(std::iter::once(label)))
    }
}

/// Error of a rejected document: its text and all faults in it.
#[derive(Clone, Debug)]
pub struct DocumentError {
    source: NamedSource<String>,
    // Boxed: results that hold this error stay small.
    first: Box<Fault>,
    rest: Vec<Fault>,
}

impl DocumentError {
    /// Creates an error with the faults in file order; `None` if there are no faults.
    pub(crate) fn of(file_name: &str, text: &str, mut faults: Vec<Fault>) -> Option<Self> {
        faults.sort_by_key(|fault| fault.span.start);
        let text = excerpt::excerpt(text, &mut faults);
        let mut faults = faults.into_iter();
        let first = Box::new(faults.next()?);
        let source = NamedSource::new(file_name, text);
        Some(Self { source, first, rest: faults.collect() })
    }

    /// Name of the file, as supplied by the caller.
    pub fn file_name(&self) -> &str {
        self.source.name()
    }

    /// Faults in file order; never empty.
    pub fn faults(&self) -> impl Iterator<Item = &Fault> {
        std::iter::once(&*self.first).chain(&self.rest)
    }
}

impl fmt::Display for DocumentError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}:{}: {}", self.source.name(), self.first.line, self.first)?;
        match self.rest.len() {
            0 => Ok(()),
            1 => write!(f, " (and 1 more error)"),
            more => write!(f, " (and {more} more errors)"),
        }
    }
}

impl std::error::Error for DocumentError {}

impl Diagnostic for DocumentError {
    fn help<'a>(&'a self) -> Option<Box<dyn fmt::Display + 'a>> {
        self.first.help()
    }

    fn labels(&self) -> Option<Box<dyn Iterator<Item = LabeledSpan> + '_>> {
        self.first.labels()
    }

    fn source_code(&self) -> Option<&dyn SourceCode> {
        Some(&self.source)
    }

    // Related faults have no text of their own: reports render them against this source.
    fn related<'a>(&'a self) -> Option<Box<dyn Iterator<Item = &'a dyn Diagnostic> + 'a>> {
        if self.rest.is_empty() {
            return None;
        }
        Some(Box::new(self.rest.iter().map(|fault| fault as &dyn Diagnostic)))
    }
}

/// Parsed TOML text with the faults found so far.
#[derive(Debug)]
pub struct Document<'t> {
    file_name: String,
    text: &'t str,
    root: Spanned<DeTable<'t>>,
    faults: RefCell<Vec<Fault>>,
}

/// Returns true if the line of a byte position contains a number with a decimal comma right before or at this position, such as
/// `= 0,6`.
fn has_decimal_comma(text: &str, at: usize) -> bool {
    let start = text[..at.min(text.len())].rfind('\n').map_or(0, |end| end + 1);
    let line = text[start..].lines().next().unwrap_or_default();
    let Some((_, value)) = line.split_once('=') else { return false };
    let Some((whole, part)) = value.trim_start().split_once(',') else { return false };
    let is_digit = |c: char| c.is_ascii_digit();
    let whole = whole.trim_start_matches(['-', '+']);
    !whole.is_empty() && whole.chars().all(is_digit) && part.starts_with(is_digit)
}

impl<'t> Document<'t> {
    /// Parses a TOML text.
    ///
    /// # Errors
    /// Returns the first syntax faults.
    pub fn parse(file_name: &str, text: &'t str) -> Result<Self, DocumentError> {
        let (root, errors) = DeTable::parse_recoverable(text);
        let faults = RefCell::new(Vec::new());
        let document = Self { file_name: file_name.to_owned(), text, root, faults };
        for error in errors.iter().take(SYNTAX_FAULTS_MAX) {
            let span = error.span().unwrap_or(0..0);
            let message = format!("this is not TOML: {}", error.message());
            let help = match has_decimal_comma(text, span.start) {
                true => "write numbers with a decimal point: 0.6 instead of 0,6",
                false => {
                    "put strings in quotes, and give each key once; https://toml.io describes the \
                     syntax"
                }
            };
            document.fault(span, message, "here", help);
        }
        if errors.is_empty() { Ok(document) } else { document.finish(None::<Self>) }
    }

    /// Text of the file.
    pub(crate) fn text(&self) -> &'t str {
        self.text
    }

    /// Top-level table.
    pub fn root(&self) -> Table<'_> {
        Table::new(self, self.root.get_ref(), 0..0, String::new())
    }

    /// Records a fault. A repeated fault with equal span, label and help is dropped, because one line of a template can be
    /// wrong for four limbs.
    pub fn fault(
        &self,
        span: Span,
        message: impl Into<String>,
        label: impl Into<String>,
        help: impl Into<String>,
    ) {
        let mut faults = self.faults.borrow_mut();
        if faults.len() == FAULTS_MAX {
            return;
        }
        let fault = Fault::new(self.text, span, message, label, help);
        let same = |known: &Fault| {
            known.span == fault.span && known.label == fault.label && known.help == fault.help
        };
        if !faults.iter().any(same) {
            faults.push(fault);
        }
    }

    /// Removes a fault that another fault explains.
    fn retract(&self, span: &Span, message: &str) {
        self.faults.borrow_mut().retain(|fault| fault.span != *span || fault.message != message);
    }

    /// Returns true if no fault has been recorded.
    pub fn is_clean(&self) -> bool {
        self.faults.borrow().is_empty()
    }

    /// Returns the value if there are no faults.
    ///
    /// # Errors
    /// Returns all recorded faults in file order.
    pub fn finish<T>(self, value: Option<T>) -> Result<T, DocumentError> {
        let faults = self.faults.into_inner();
        if let (true, Some(value)) = (faults.is_empty(), value) {
            return Ok(value);
        }
        let faults = DocumentError::of(&self.file_name, self.text, faults);
        // A reader that gives up without a fault is a bug there; say so instead of panicking.
        Err(faults.unwrap_or_else(|| DocumentError {
            source: NamedSource::new(self.file_name, self.text.to_owned()),
            first: Box::new(Fault::new(
                self.text,
                0..0,
                "the reader of the file refused it without a reason",
                "in this part of the file",
                "please report this file as a bug",
            )),
            rest: Vec::new(),
        }))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_decimal_comma_is_seen_in_its_line_alone() {
        let text = "a = 0.5\nnominal_rad = -0,6 # comment\nc = [1, 2]\nd = \"1,2\"\n";
        let at = |of: &str| text.find(of).unwrap();
        assert!(has_decimal_comma(text, at("0,6")));
        assert!(has_decimal_comma(text, at(",6")));
        for other in ["a = ", "c = ", "\"1,2"] {
            assert!(!has_decimal_comma(text, at(other)), "{other}");
        }
        assert!(!has_decimal_comma("", 10));
    }
}
