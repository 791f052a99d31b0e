//! Multipliers of a solve: taken over from a neighbouring one, or estimated.

use super::normal::{NormalEquations, row_energy};
use crate::families::Family;
use crate::formulation::rows::{Role, Row, Rows};
use serde::{Deserialize, Serialize};

/// The multipliers of a solution, as shifts of its rows (see [`crate::formulation`]).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Multipliers {
    /// The shift of every row.
    shifts: Vec<f64>,
    /// Families of the rows, by which two patterns of rows are compared.
    families: Vec<Family>,
    /// Penalty to which the shifts belong.
    penalty: f64,
}

impl Multipliers {
    /// Multipliers of rows in their order.
    pub(crate) fn of(rows: &Rows, shifts: Vec<f64>, penalty: f64) -> Self {
        Self { shifts, families: rows.rows.iter().map(|row| row.family).collect(), penalty }
    }

    /// True if the multipliers can be carried. Multipliers from outside need this check.
    pub(crate) fn are_sound(&self) -> bool {
        let numbers = self.shifts.iter().chain([&self.penalty]);
        self.shifts.len() == self.families.len() && numbers.copied().all(f64::is_finite)
    }

    /// Shifts for other rows and another penalty, if the rows have the same pattern. The force of a multiplier is
    /// penalty × shift.
    pub(crate) fn carried(&self, rows: &Rows, penalty: f64) -> Option<Vec<f64>> {
        let same = self.families.iter().eq(rows.rows.iter().map(|row| &row.family));
        let scale = self.penalty / penalty;
        same.then(|| self.shifts.iter().map(|shift| shift * scale).collect())
    }
}

/// Shift that replaces `shift` when the row's residual is `value`.
pub(super) fn first_order_shift(row: &Row, value: f64, shift: f64) -> f64 {
    match row.role {
        Role::Equality => value + shift,
        Role::Inequality { .. } => row_energy(&Row { value, ..row.clone() }, shift, 1.0)[1] / 2.0,
        Role::Cost { .. } => 0.0,
    }
}

/// Estimates shifts from the linearised rows at the end of a Gauss-Newton step, by the update of the method of
/// multipliers. Near an optimum the estimate is nearly exact, so that a plan without multipliers need not first move
/// away from its constraints to find them.
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
    rows.rows
        .iter()
        .map(|row| {
            let change: f64 =
                entries(row).map(|k| rows.derivatives[k] * step[rows.columns[k]]).sum();
            first_order_shift(row, row.value + change, 0.0)
        })
        .collect()
}
