//! Terms: each writes the rows of one family.

use super::rows::{RowWriter, Window};
use crate::families::Family;

/// Samples that a term is computed from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Span {
    /// Samples of the motion, each with its neighbours.
    Samples,
    /// Intervals of the motion. Samples 1 and 2 of the window are the ends of the interval.
    Intervals,
    /// Single window per motion. Its samples 1 and 2 are the first sample and the sample at which the displacement is measured.
    Ends,
}

/// Description of a term's rows.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct TermInfo {
    /// Family of the rows.
    pub family: Family,
    /// Samples that the rows are computed from.
    pub span: Span,
}

/// Term of the formulation: writes one family of residuals.
pub trait Term: Sync {
    /// Returns the description of the rows.
    fn info(&self) -> TermInfo;
    /// Writes the rows of one window, with derivatives.
    fn write(&self, window: &Window, out: &mut RowWriter);
}
