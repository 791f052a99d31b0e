//! Benchmarks of rows that know nothing of each other, so that they can be split over cores and machines.

use crate::Findings;
use miette::{IntoDiagnostic, miette};
use serde::Serialize;
use serde::de::DeserializeOwned;
use serde_json::Value;
use std::collections::BTreeMap;

/// A benchmark that is computed in units, by whom it may be.
pub trait Split: Sync {
    /// Words of the command line behind `bench`: the name, and all options. The same words ask for the same work.
    fn words(&self) -> Vec<String>;
    /// Texts of the user's own files on which the work depends.
    fn inputs(&self) -> Vec<String> {
        Vec::new()
    }
    fn units(&self) -> usize;
    /// Name of the units in messages.
    fn units_name(&self) -> &'static str;
    /// True if it measures times, so that units must not disturb each other.
    fn is_timed(&self) -> bool;
    /// Computes a unit; `None` after an interrupt.
    ///
    /// # Errors
    /// An input that cannot be used, or what the computation reports.
    fn unit(&self, index: usize) -> miette::Result<Option<Value>>;
    /// Findings from the results of units, by number: of all units, or of those done before an interrupt.
    ///
    /// # Errors
    /// They are not of this benchmark.
    fn findings(&self, units: &BTreeMap<usize, Value>) -> miette::Result<Findings>;
}

/// Computes a row of something; `None` after an interrupt.
pub type Row<'a, T, R> = dyn Fn(&T) -> miette::Result<Option<R>> + Sync + 'a;
/// Findings of rows.
pub type Found<'a, R> = dyn Fn(&[R]) -> Findings + Sync + 'a;

/// A benchmark of which each unit is a row.
pub struct Rows<'a, T, R> {
    /// [`Split::words`].
    pub words: Vec<String>,
    /// [`Split::inputs`].
    pub inputs: Vec<String>,
    /// [`Split::is_timed`].
    pub is_timed: bool,
    /// Inputs of the rows.
    pub rows: Vec<T>,
    /// Computation of a row.
    pub row: Box<Row<'a, T, R>>,
    /// Findings of rows.
    pub findings: Box<Found<'a, R>>,
}

impl<T: Sync, R: Serialize + DeserializeOwned> Split for Rows<'_, T, R> {
    fn words(&self) -> Vec<String> {
        self.words.clone()
    }

    fn inputs(&self) -> Vec<String> {
        self.inputs.clone()
    }

    fn units(&self) -> usize {
        self.rows.len()
    }

    fn units_name(&self) -> &'static str {
        "rows"
    }

    fn is_timed(&self) -> bool {
        self.is_timed
    }

    fn unit(&self, index: usize) -> miette::Result<Option<Value>> {
        (self.row)(&self.rows[index])?.as_ref().map(written).transpose()
    }

    fn findings(&self, units: &BTreeMap<usize, Value>) -> miette::Result<Findings> {
        let rows: Vec<R> = units.values().map(read).collect::<miette::Result<_>>()?;
        Ok((self.findings)(&rows))
    }
}

/// A result of a unit, as others read it.
pub fn written(result: &impl Serialize) -> miette::Result<Value> {
    serde_json::to_value(result).into_diagnostic()
}

/// A result of a unit.
pub fn read<R: DeserializeOwned>(value: &Value) -> miette::Result<R> {
    R::deserialize(value)
        .map_err(|error| miette!("a journal has a result of something else: {error}"))
}
