//! Faults and warnings about a URDF file. Faults end the import.

use crate::document::{DocumentError, FAULTS_MAX, Fault, Span, line_at};
use std::fmt::Display;

const WARNINGS_MAX: usize = 100;

/// Faults and warnings about the text of a URDF.
#[derive(Debug)]
pub(super) struct Notes<'t> {
    pub file_name: &'t str,
    pub text: &'t str,
    pub faults: Vec<Fault>,
    pub warnings: Vec<String>,
}

impl<'t> Notes<'t> {
    pub fn new(file_name: &'t str, text: &'t str) -> Self {
        Self { file_name, text, faults: Vec::new(), warnings: Vec::new() }
    }

    /// True if the list of faults is full.
    pub fn is_full(&self) -> bool {
        self.faults.len() >= FAULTS_MAX
    }

    pub fn fault(
        &mut self,
        span: Span,
        message: impl Into<String>,
        label: impl Into<String>,
        help: impl Into<String>,
    ) {
        if !self.is_full() {
            self.faults.push(Fault::new(self.text, span, message, label, help));
        }
    }

    pub fn warn(&mut self, span: &Span, message: impl Display) {
        if self.warnings.len() == WARNINGS_MAX {
            return;
        }
        let line = line_at(self.text, span.start);
        self.warnings.push(format!("{}:{line}: {message}", self.file_name));
    }

    /// Returns the faults so far as an error.
    pub fn check(&mut self) -> Result<(), DocumentError> {
        let faults = std::mem::take(&mut self.faults);
        DocumentError::of(self.file_name, self.text, faults).map_or(Ok(()), Err)
    }
}
