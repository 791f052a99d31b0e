//! Exceptions: their classes are in `rollwalk/_errors.py`, their words are those of the command line.

use crate::plan::{self, Diagnosis};
use miette::{Diagnostic, GraphicalReportHandler, GraphicalTheme};
use pyo3::exceptions::PyOSError;
use pyo3::{IntoPyObjectExt, PyErr, Python, import_exception};
use rollwalk_planner::plan::Plan;
use rollwalk_planner::report::Report;
use rollwalk_protocol::text::ShownLines;
use std::fmt::Display;
use std::io;
use std::path::Path;

import_exception!(rollwalk._errors, RollwalkError);
import_exception!(rollwalk._errors, DoesNotHold);
import_exception!(rollwalk._errors, Infeasible);

/// What is wrong with an input, as the command line shows it on a terminal without colours: message, place, help.
pub fn wrong(diagnostic: impl Diagnostic) -> PyErr {
    let handler = GraphicalReportHandler::new_themed(GraphicalTheme::unicode_nocolor());
    let handler = handler.with_links(false).with_wrap_lines(false);
    let mut text = String::new();
    // Writing into a string does not fail.
    let _ = handler.render_report(&mut text, &diagnostic);
    // An exception begins behind its class, and its excerpt on a line of its own.
    refused(format!("\n{}", ShownLines(text.trim_end())))
}

/// What cannot be done, in one sentence.
pub fn refused(reason: impl Display) -> PyErr {
    RollwalkError::new_err(reason.to_string())
}

/// What the operating system refuses, as the built-in exception for it, such as `FileNotFoundError`.
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

/// Plans that do not hold, in the words of the command line. The exception carries the first of them.
pub fn does_not_hold(py: Python<'_>, plans: &[&Plan]) -> PyErr {
    let words =
        |plan: &&Plan| format!("{} {}", plan.motion.name, Report::new(plan).words(&plan.solve));
    let text = plans.iter().map(words).collect::<Vec<_>>().join("\n");
    let Some(first) = plans.first() else { return refused(text) };
    let best = plan::Plan::of((*first).clone()).into_py_any(py);
    match (best, first.solve.diagnosis.as_ref()) {
        (Ok(best), Some(diagnosis)) => match Diagnosis::of(diagnosis).into_py_any(py) {
            Ok(diagnosis) => Infeasible::new_err((text, best, diagnosis)),
            Err(error) => error,
        },
        (Ok(best), None) => DoesNotHold::new_err((text, best)),
        (Err(error), _) => error,
    }
}
