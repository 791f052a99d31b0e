//! Residual reports of plans.

use pyo3::prelude::*;
use rollwalk_planner::plan::Plan;
use rollwalk_planner::report as reported;

/// Residuals of a plan, recomputed from its values as by `rollwalk report`.
#[pyclass(frozen, module = "rollwalk")]
pub struct Report {
    rows: Vec<reported::Row>,
    /// True if the plan is consistent: every residual is within its tolerance, or the motion is marked as needing feedback.
    #[pyo3(get)]
    consistent: bool,
    /// Verdict as a sentence, with the decisive residual.
    #[pyo3(get)]
    verdict: String,
    table: String,
}

impl Report {
    /// Computes the report of a validated plan.
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
    /// Residuals: at the samples first, then between the samples, as the motion is played.
    #[getter]
    fn residuals(&self) -> Vec<Residual> {
        self.rows.iter().map(Residual::of).collect()
    }

    fn __str__(&self) -> String {
        format!("{}{}", self.table, self.verdict)
    }
}

/// Worst value of one kind of residual over the whole motion.
#[pyclass(frozen, module = "rollwalk")]
pub struct Residual {
    /// Name of the constraint.
    #[pyo3(get)]
    name: &'static str,
    /// Number of the equation in the thesis, or a description.
    #[pyo3(get)]
    equation: &'static str,
    /// Times of evaluation: `at the samples`, `as played, 60 Hz`, `as played, 500 Hz`.
    #[pyo3(get)]
    grid: String,
    /// Worst value, in `unit`. For limits, the excess over the limit, or 0 within the limit.
    #[pyo3(get)]
    worst: f64,
    /// Unit of `worst` and `tolerance`.
    #[pyo3(get)]
    unit: &'static str,
    /// Tolerance below which motions pass in an independent simulator; `None` for residuals without a tolerance.
    #[pyo3(get)]
    tolerance: Option<f64>,
    /// Time of the worst value, s; `None` if the residual is 0 everywhere.
    #[pyo3(get)]
    time_s: Option<f64>,
    /// Joint, end effector or links with the worst value.
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
