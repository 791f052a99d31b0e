//! Results on stdout as text or JSON, and messages on stderr. The program ends quietly if the reader closes the pipe.
//!
//! All output passes through this module, which escapes control characters, because names in files may be untrusted.

use miette::{
    Diagnostic, LabeledSpan, MietteHandlerOpts, Report, ReportHandler, Severity, SourceCode,
};
use rollwalk_protocol::text::ShownLines;
use serde::Serialize;
use std::fmt::{self, Display};
use std::io::{self, Write};
use thiserror::Error;

/// Maximum length of a line of a message, characters.
const LINE_MAX: usize = 2000;

/// Error if the reader of our output has closed it (`rollwalk ... | head`).
#[derive(Debug, Error, Diagnostic)]
#[error("the output was closed")]
pub struct PipeClosed;

/// Prints a result, followed by a line break. A reader that closes the pipe (`| head`) does not change the exit code.
///
/// # Errors
/// Returns an error if the operating system cannot write.
pub fn print(text: &str) -> miette::Result<()> {
    line(text).or_else(|error| if error.is::<PipeClosed>() { Ok(()) } else { Err(error) })
}

/// Prints a line of a stream that ends when its reader closes it.
///
/// # Errors
/// Returns [`PipeClosed`], or an error of the operating system.
pub fn line(text: &str) -> miette::Result<()> {
    let mut stdout = io::stdout().lock();
    let outcome = writeln!(stdout, "{}", ShownLines(text.trim_end())).and_then(|()| stdout.flush());
    outcome.map_err(|error| match error.kind() {
        io::ErrorKind::BrokenPipe => PipeClosed.into(),
        _ => miette::miette!("cannot write to standard output: {error}"),
    })
}

/// Prints a line on stderr. A closed stderr is ignored, because it is no reason to end a run; `eprintln!` would panic.
pub fn print_line(text: impl Display) {
    // A failure could be reported only to the same stream.
    let _ = writeln!(io::stderr().lock(), "{}", escaped(text));
}

/// Prints warnings to stderr.
pub fn print_warnings(warnings: &[String]) {
    for warning in warnings {
        print_line(format_args!("warning: {warning}"));
    }
}

/// Prints the error of a failed run on stderr, with colours if the terminal supports them.
pub fn print_report(report: &Report) {
    let _ = writeln!(io::stderr().lock(), "{}", ReportText(report));
}

/// Adapter that formats a report as text.
struct ReportText<'r>(&'r Report);

impl Display for ReportText<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        // Errors contain commands to type. A line break within a command would break its copy.
        let handler = MietteHandlerOpts::new().wrap_lines(false).build();
        handler.debug(&EscapedDiagnostic::of(self.0.as_ref()), f)
    }
}

/// Diagnostic with control characters escaped. Its source excerpt is escaped elsewhere.
struct EscapedDiagnostic<'d> {
    of: &'d dyn Diagnostic,
    message: String,
    labels: Vec<LabeledSpan>,
    related: Vec<EscapedDiagnostic<'d>>,
    cause: Option<Cause>,
}

/// Cause of an error: its message, and the next cause.
#[derive(Debug, Error)]
#[error("{message}")]
struct Cause {
    message: String,
    source: Option<Box<Cause>>,
}

impl Cause {
    fn of(error: &dyn std::error::Error) -> Self {
        let source = error.source().map(|source| Box::new(Self::of(source)));
        Self { message: escaped(error), source }
    }
}

/// Escapes control characters in a message and shortens long lines, because messages quote untrusted files.
fn escaped(text: impl Display) -> String {
    let text = text.to_string();
    let cut = |line: &str| match line.char_indices().nth(LINE_MAX) {
        Some((end, _)) => format!("{}…", &line[..end]),
        None => line.to_owned(),
    };
    let lines: Vec<String> = text.split('\n').map(cut).collect();
    ShownLines(&lines.join("\n")).to_string()
}

impl<'d> EscapedDiagnostic<'d> {
    fn of(of: &'d dyn Diagnostic) -> Self {
        let label = |label: LabeledSpan| {
            LabeledSpan::new_with_span(label.label().map(escaped), *label.inner())
        };
        Self {
            of,
            message: escaped(of),
            labels: of.labels().into_iter().flatten().map(label).collect(),
            related: of.related().into_iter().flatten().map(Self::of).collect(),
            cause: of.source().map(Cause::of),
        }
    }
}

impl fmt::Debug for EscapedDiagnostic<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.message)
    }
}

impl Display for EscapedDiagnostic<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.message)
    }
}

impl std::error::Error for EscapedDiagnostic<'_> {
    fn source(&self) -> Option<&(dyn std::error::Error + 'static)> {
        self.cause.as_ref().map(|cause| cause as _)
    }
}

impl Diagnostic for EscapedDiagnostic<'_> {
    fn severity(&self) -> Option<Severity> {
        self.of.severity()
    }

    fn help<'a>(&'a self) -> Option<Box<dyn Display + 'a>> {
        self.of.help().map(|help| Box::new(escaped(help)) as _)
    }

    fn source_code(&self) -> Option<&dyn SourceCode> {
        self.of.source_code()
    }

    fn labels(&self) -> Option<Box<dyn Iterator<Item = LabeledSpan> + '_>> {
        (!self.labels.is_empty()).then(|| Box::new(self.labels.iter().cloned()) as _)
    }

    fn related<'a>(&'a self) -> Option<Box<dyn Iterator<Item = &'a dyn Diagnostic> + 'a>> {
        let related = self.related.iter().map(|related| related as &dyn Diagnostic);
        (!self.related.is_empty()).then(|| Box::new(related) as _)
    }
}

/// Prints a result as JSON.
///
/// # Errors
/// Returns the errors of [`print()`].
pub fn print_json(value: &impl Serialize) -> miette::Result<()> {
    let text = serde_json::to_string_pretty(value)
        .map_err(|error| miette::miette!("cannot write JSON: {error}"))?;
    print(&text)
}

/// Removes the minus sign of a zero, such as `-0.00`. Other text stays unchanged.
pub fn unsigned_zero(number: String) -> String {
    let zero = number.strip_prefix('-').filter(|digits| digits.starts_with('0'));
    match zero.filter(|digits| digits.bytes().all(|byte| byte == b'0' || byte == b'.')) {
        Some(zero) => zero.to_owned(),
        None => number,
    }
}

/// Formats a value with `DECIMALS` decimals, without a minus sign for zero.
pub fn fixed<const DECIMALS: usize>(value: f64) -> String {
    unsigned_zero(format!("{value:.DECIMALS$}"))
}

/// Table with aligned columns: the first column to the left, numbers to the right.
pub struct Table {
    rows: Vec<Vec<String>>,
}

/// Creates a table from rows; the first row contains the titles.
impl From<Vec<Vec<String>>> for Table {
    fn from(rows: Vec<Vec<String>>) -> Self {
        Self { rows }
    }
}

impl Table {
    /// Creates a table with the given column titles.
    pub fn new<const N: usize>(titles: [&str; N]) -> Self {
        Self { rows: vec![titles.map(str::to_owned).to_vec()] }
    }

    pub fn row<const N: usize>(&mut self, cells: [String; N]) {
        self.rows.push(cells.map(unsigned_zero).to_vec());
    }

    /// Formats the table as text, with two blanks between columns and a rule below the titles.
    pub fn render(&self) -> String {
        let columns = self.rows.iter().map(Vec::len).max().unwrap_or(0);
        let width = |column: usize| {
            let cells = self.rows.iter().filter_map(|row| row.get(column));
            cells.map(|cell| cell.chars().count()).max().unwrap_or(0)
        };
        let widths: Vec<usize> = (0..columns).map(width).collect();
        let mut lines = Vec::new();
        for (number, row) in self.rows.iter().enumerate() {
            let cells = row.iter().zip(&widths).enumerate().map(|(column, (cell, &width))| {
                // A width in a format string must fit into 16 bits.
                let blanks = " ".repeat(width - cell.chars().count());
                if column == 0 { format!("{cell}{blanks}") } else { format!("{blanks}{cell}") }
            });
            lines.push(cells.collect::<Vec<_>>().join("  ").trim_end().to_owned());
            if number == 0 {
                let rule: Vec<String> = widths.iter().map(|&width| "─".repeat(width)).collect();
                lines.push(rule.join("  "));
            }
        }
        lines.join("\n")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_others_wrote_does_not_reach_the_terminal_as_it_is() {
        let report = miette::miette!(help = "try \x1b[31mred", "no motion `\x1b[2Jwalk`");
        let report = report.wrap_err("reading \u{202e}x");
        let text = ReportText(&report).to_string();
        assert!(text.contains("\\u001b[2Jwalk") && text.contains("\\u001b[31mred"), "{text}");
        assert!(text.contains("reading \\u202ex"), "{text}");
    }

    #[test]
    fn messages_have_no_endless_lines() {
        let text = "é\u{1b}".repeat(10 << 20);
        let report = miette::miette!(help = text.clone(), "a\n{text}").wrap_err(text);
        let shown = ReportText(&report).to_string();
        assert!(shown.len() < 40_000 && shown.contains('…'), "{} bytes", shown.len());
    }

    #[test]
    fn a_cell_may_have_any_length() {
        let mut table = Table::new(["a", "b"]);
        table.row(["x".repeat(70_000), "y".repeat(70_000)]);
        let text = table.render();
        assert_eq!(text.lines().last().unwrap().len(), 140_002);
    }

    #[test]
    fn zeros_in_tables_have_no_sign() {
        let mut table = Table::new(["joint", "rad", "rad/s"]);
        table.row(["hip".into(), format!("{:.3}", -0.0001), format!("{:.3}", -0.1)]);
        let last = table.render().lines().last().unwrap().to_owned();
        assert_eq!(last, "hip    0.000  -0.100");
        assert_eq!(unsigned_zero("-".into()), "-");
        assert_eq!(unsigned_zero("-0".into()), "0");
        assert_eq!((fixed::<2>(-0.001), fixed::<2>(-1.5)), ("0.00".into(), "-1.50".into()));
    }

    #[test]
    fn columns_line_up() {
        let mut table = Table::new(["motion", "time"]);
        table.row(["walk".into(), "1.25 s".into()]);
        table.row(["turn_in_place".into(), "0.1 s".into()]);
        let expected = "\
motion           time
─────────────  ──────
walk           1.25 s
turn_in_place   0.1 s";
        assert_eq!(table.render(), expected);
    }
}
