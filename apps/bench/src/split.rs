//! Benchmarks with independent rows, which can be split over cores and machines.

use crate::Findings;
use miette::{IntoDiagnostic, miette};
use serde::Serialize;
use serde::de::DeserializeOwned;
use serde_json::Value;
use std::collections::BTreeMap;

/// Benchmark that is computed in units, possibly by several processes.
pub trait Split: Sync {
    /// Command-line arguments after `bench`: the name and all options. Equal arguments select equal work.
    fn words(&self) -> Vec<String>;
    /// Contents of the user's files that the work depends on.
    fn inputs(&self) -> Vec<String> {
        Vec::new()
    }
    fn units(&self) -> usize;
    /// Name of the units in messages.
    fn units_name(&self) -> &'static str;
    /// True if the benchmark measures times, so that units must not disturb each other.
    fn is_timed(&self) -> bool;
    /// Computes a unit; `None` after an interrupt.
    ///
    /// # Errors
    /// Returns an error if an input cannot be used, or if the computation fails.
    fn unit(&self, index: usize) -> miette::Result<Option<Value>>;
    /// Findings from the results of units, by index. After an interrupt some units may be missing.
    ///
    /// # Errors
    /// Returns an error if the results do not belong to this benchmark.
    fn findings(&self, units: &BTreeMap<usize, Value>) -> miette::Result<Findings>;
}

/// Function that computes a row; `None` after an interrupt.
pub type Row<'a, T, R> = dyn Fn(&T) -> miette::Result<Option<R>> + Sync + 'a;
/// Function that computes the findings of rows.
pub type FindingsOfRows<'a, R> = dyn Fn(&[R]) -> Findings + Sync + 'a;

/// Benchmark whose units are rows.
pub struct Rows<'a, T, R> {
    /// Command-line arguments that [`Split::words`] returns.
    pub words: Vec<String>,
    /// Contents of the user's files that [`Split::inputs`] returns.
    pub inputs: Vec<String>,
    /// Timing flag that [`Split::is_timed`] returns.
    pub is_timed: bool,
    /// Inputs of the rows.
    pub rows: Vec<T>,
    /// Computation of a row.
    pub row: Box<Row<'a, T, R>>,
    /// Computation of the findings.
    pub findings: Box<FindingsOfRows<'a, R>>,
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

/// Converts the result of a unit to JSON.
pub fn written(result: &impl Serialize) -> miette::Result<Value> {
    serde_json::to_value(result).into_diagnostic()
}

/// Parses the result of a unit.
pub fn read<R: DeserializeOwned>(value: &Value) -> miette::Result<R> {
    R::deserialize(value)
        .map_err(|error| miette!("a journal contains a result of another run: {error}"))
}
