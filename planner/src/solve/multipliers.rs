//! Multipliers of a solve: reused from a neighbouring one, or estimated.

use super::normal::{NormalEquations, row_energy};
use crate::families::Family;
use crate::formulation::rows::{Role, Row, Rows};
use serde::{Deserialize, Serialize};

/// Multipliers of a solution, as shifts of its rows (see [`crate::formulation`]).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Multipliers {
    /// Shift of every row.
    shifts: Vec<f64>,
    /// Families of the rows, for the comparison of patterns.
    families: Vec<Family>,
    /// Penalty to which the shifts belong.
    penalty: f64,
}

impl Multipliers {
    /// Creates the multipliers of rows from their shifts.
    pub(crate) fn of(rows: &Rows, shifts: Vec<f64>, penalty: f64) -> Self {
        Self { shifts, families: rows.rows.iter().map(|row| row.family).collect(), penalty }
    }

    /// Returns true if the multipliers are complete and finite. Multipliers from a file need this check.
    pub(crate) fn are_sound(&self) -> bool {
        let numbers = self.shifts.iter().chain([&self.penalty]);
        self.shifts.len() == self.families.len() && numbers.copied().all(f64::is_finite)
    }

    /// Converts the shifts to other rows and another penalty; `None` if the rows have another pattern. The force of a
    /// multiplier is penalty × shift.
    pub(crate) fn carried(&self, rows: &Rows, penalty: f64) -> Option<Vec<f64>> {
        let same = self.families.iter().eq(rows.rows.iter().map(|row| &row.family));
        let scale = self.penalty / penalty;
        same.then(|| self.shifts.iter().map(|shift| shift * scale).collect())
    }
}

/// Returns the new shift of a row with the residual `value`, which replaces `shift`.
pub(super) fn first_order_shift(row: &Row, value: f64, shift: f64) -> f64 {
    match row.role {
        Role::Equality => value + shift,
        Role::Inequality { .. } => row_energy(row, value, shift, 1.0)[1] / 2.0,
        Role::Cost { .. } => 0.0,
    }
}

/// Estimates shifts from the linearised rows at the end of a Gauss-Newton step, by the update of the method of multipliers. Near
/// an optimum, the estimate is nearly exact. A solve from a plan without multipliers then need not violate the constraints first
/// to find them.
pub(super) fn estimate(
    rows: &Rows,
    normal: &mut NormalEquations,
    penalty: f64,
    damping: f64,
) -> Vec<f64> {
    let none = vec![0.0; rows.rows.len()];
    normal.assemble(rows, &none, penalty);
    let Some(step) = normal.step(damping) else { return none };
    let entries = |row: &Row| row.entries.clone();
    rows.iter()
        .map(|(row, value)| {
            let change: f64 =
                entries(row).map(|k| rows.derivatives[k] * step[rows.columns[k]]).sum();
            first_order_shift(row, value + change, 0.0)
        })
        .collect()
}
