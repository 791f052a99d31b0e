//! Terms: writers of the rows of one family.

use super::rows::{RowWriter, Window};
use crate::families::Family;

/// Samples from which a term is computed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Span {
    /// Samples of the motion, each with its neighbours.
    Samples,
    /// Intervals of the motion: samples 1 and 2 of the window are the ends of the interval.
    Intervals,
    /// Once: samples 1 and 2 of the window are the first sample and the one at which the
    /// displacement is measured.
    Ends,
}

/// Description of a term's rows.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct TermInfo {
    /// Family of its rows.
    pub family: Family,
    /// Samples from which they are computed.
    pub span: Span,
}

/// Writer of one family of residuals.
pub trait Term: Sync {
    /// Describes its rows.
    fn info(&self) -> TermInfo;
    /// Writes its rows for one window, with derivatives.
    fn write(&self, window: &Window, out: &mut RowWriter);
}
