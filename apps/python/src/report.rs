//! Reports on plans.

use pyo3::prelude::*;
use rollwalk_planner::plan::Plan;
use rollwalk_planner::report as reported;

/// Residuals of a plan, recomputed from its numbers as by `rollwalk report`.
#[pyclass(frozen, module = "rollwalk")]
pub struct Report {
    rows: Vec<reported::Row>,
    /// True if the plan is consistent: every residual is within its tolerance, or the motion is marked as needing feedback.
    #[pyo3(get)]
    consistent: bool,
    /// The verdict in words, with the residual that decides.
    #[pyo3(get)]
    verdict: String,
    table: String,
}

impl Report {
    /// Report on a validated plan.
    pub fn of(plan: &Plan) -> Self {
        let report = reported::Report::new(plan);
        Self {
            consistent: report.judgement.is_good(),
            verdict: report.words(&plan.solve),
            table: report.to_string(),
            rows: report.rows,
        }
    }
}

#[pymethods]
impl Report {
    /// The residuals: at the samples first, then in between, as the motion is played.
    #[getter]
    fn residuals(&self) -> Vec<Residual> {
        self.rows.iter().map(Residual::of).collect()
    }

    fn __str__(&self) -> String {
        format!("{}{}", self.table, self.verdict)
    }
}

/// The worst of one kind of residual over the whole motion.
#[pyclass(frozen, module = "rollwalk")]
pub struct Residual {
    /// Name of the constraint.
    #[pyo3(get)]
    name: &'static str,
    /// Number of its equation in the thesis, or a description.
    #[pyo3(get)]
    equation: &'static str,
    /// Times of evaluation: `at the samples`, `as played, 60 Hz`, `as played, 500 Hz`.
    #[pyo3(get)]
    grid: String,
    /// Worst value, in `unit`. Of limits the excess, 0 within the limit.
    #[pyo3(get)]
    worst: f64,
    /// Unit of `worst` and `tolerance`.
    #[pyo3(get)]
    unit: &'static str,
    /// Bound up to which motions hold in an independent simulator; `None` for residuals without one.
    #[pyo3(get)]
    tolerance: Option<f64>,
    /// Time of the worst value, s; `None` if it is 0 everywhere.
    #[pyo3(get)]
    time_s: Option<f64>,
    /// Joint, end effector or links that it belongs to.
    #[pyo3(get)]
    subject: Option<String>,
    /// True if the residual is within its tolerance.
    #[pyo3(get)]
    holds: bool,
    words: String,
}

impl Residual {
    fn of(row: &reported::Row) -> Self {
        Self {
            name: row.family.name(),
            equation: row.equation,
            grid: row.grid.to_string(),
            worst: row.worst,
            unit: row.unit,
            tolerance: row.level,
            time_s: row.place.as_ref().map(|place| place.time_s),
            subject: row.place.as_ref().and_then(|place| place.subject.clone()),
            holds: !row.is_beyond(),
            words: row.to_string(),
        }
    }
}

#[pymethods]
impl Residual {
    fn __str__(&self) -> &str {
        &self.words
    }
}
