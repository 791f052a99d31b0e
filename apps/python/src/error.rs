//! Exceptions. The classes are in `rollwalk/_errors.py`, and the messages are those of the command line. Module `plan` has the
//! exceptions about plans.

use miette::{Diagnostic, GraphicalReportHandler, GraphicalTheme};
use pyo3::exceptions::PyOSError;
use pyo3::{PyErr, import_exception};
use rollwalk_protocol::text::ShownLines;
use std::fmt::Display;
use std::io;
use std::path::Path;

import_exception!(rollwalk._errors, RollwalkError);

/// Error for a wrong input, with the text that the command line prints on a terminal without colours: message, location, help.
pub fn input_error(diagnostic: impl Diagnostic) -> PyErr {
    let handler = GraphicalReportHandler::new_themed(GraphicalTheme::unicode_nocolor());
    let handler = handler.with_links(false).with_wrap_lines(false);
    let mut text = String::new();
    // Writing into a string does not fail.
    let _ = handler.render_report(&mut text, &diagnostic);
    // Python prints the message behind the name of the exception, so the excerpt needs its own line.
    refused(format!("\n{}", ShownLines(text.trim_end())))
}

/// Error for a request that cannot be fulfilled, as one sentence.
pub fn refused(reason: impl Display) -> PyErr {
    RollwalkError::new_err(reason.to_string())
}

/// Error of the operating system as the matching built-in exception, such as `FileNotFoundError`.
pub fn refused_by_system(action: &str, path: &Path, error: &io::Error) -> PyErr {
    match error.raw_os_error() {
        Some(code) => {
            let reason = error.to_string();
            let reason = reason.split(" (os error").next().unwrap_or(&reason);
            PyOSError::new_err((code, format!("{action}: {reason}"), path.as_os_str().to_owned()))
        }
        None => refused(format!("{action}: {}: {error}", path.display())),
    }
}
