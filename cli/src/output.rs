//! Results on stdout as text or JSON, messages on stderr; ends quietly when the reader has closed the pipe.

use miette::Diagnostic;
use serde::Serialize;
use std::fmt::Display;
use std::io::{self, Write};
use thiserror::Error;

/// The reader of our output closed it (`rollwalk ... | head`).
#[derive(Debug, Error, Diagnostic)]
#[error("the output was closed")]
pub struct PipeClosed;

/// Prints a result, followed by a line break.
///
/// # Errors
/// [`PipeClosed`], or an error of the operating system.
pub fn print(text: &str) -> miette::Result<()> {
    let mut stdout = io::stdout().lock();
    let outcome = writeln!(stdout, "{}", text.trim_end()).and_then(|()| stdout.flush());
    outcome.map_err(|error| match error.kind() {
        io::ErrorKind::BrokenPipe => PipeClosed.into(),
        _ => miette::miette!("cannot write to standard output: {error}"),
    })
}

/// Prints a line on stderr and ignores that stderr is closed, which is no reason to end a run: `eprintln!` would
/// panic.
pub fn say(text: impl Display) {
    // A failure could only be reported in the same place.
    let _ = writeln!(io::stderr().lock(), "{text}");
}

/// Prints a result as JSON.
///
/// # Errors
/// As [`print`].
pub fn print_json(value: &impl Serialize) -> miette::Result<()> {
    let text = serde_json::to_string_pretty(value)
        .map_err(|error| miette::miette!("cannot write JSON: {error}"))?;
    print(&text)
}

/// A table with aligned columns: the first column to the left, numbers to the right.
pub struct Table {
    rows: Vec<Vec<String>>,
}

/// Of rows, the first of which has the titles.
impl From<Vec<Vec<String>>> for Table {
    fn from(rows: Vec<Vec<String>>) -> Self {
        Self { rows }
    }
}

impl Table {
    /// A table with these column titles.
    pub fn new<const N: usize>(titles: [&str; N]) -> Self {
        Self { rows: vec![titles.map(str::to_owned).to_vec()] }
    }

    /// Adds a row.
    pub fn row<const N: usize>(&mut self, cells: [String; N]) {
        self.rows.push(cells.to_vec());
    }

    /// The table as text, columns two blanks apart, a rule below the titles.
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
                if column == 0 { format!("{cell:<width$}") } else { format!("{cell:>width$}") }
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
    use super::Table;

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
