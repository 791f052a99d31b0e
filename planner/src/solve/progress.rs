//! Progress of a solve: energy, cost and the worst constraint.

use super::normal::row_energy;
use crate::families::Family;
use crate::formulation::rows::{Role, Row, Rows};

/// Progress of a solve, passed to the caller after every iteration.
#[derive(Clone, Debug)]
pub struct Progress {
    /// Number of iterations so far, from the present start.
    pub iteration: usize,
    /// Energy E(m).
    pub energy: f64,
    /// Sum of the costs in the energy.
    pub cost: f64,
    /// Residual-to-tolerance ratio of the worst constraint.
    pub worst_level: f64,
    /// Family of the worst constraint.
    pub worst_constraint: Family,
    /// Damping λ.
    pub damping: f64,
    /// Length of the step, scaled variables.
    pub step: f64,
}

impl Progress {
    /// Creates the progress at a point with the given rows and energy. `worst` contains the index of the worst constraint row
    /// and its residual-to-tolerance ratio.
    pub fn at(rows: &Rows, worst: (usize, f64), energy: f64, penalty: f64) -> Self {
        let costs = rows.iter().filter(|(row, _)| matches!(row.role, Role::Cost { .. }));
        Self {
            iteration: 0,
            energy,
            cost: costs.map(|(row, value)| row_energy(row, value, 0.0, penalty)[0]).sum(),
            worst_level: worst.1,
            worst_constraint: rows.rows[worst.0].family,
            damping: 0.0,
            step: 0.0,
        }
    }
}

/// Residual-to-tolerance ratio of a constraint; 0 for costs.
pub fn level(row: &Row, value: f64) -> f64 {
    match row.role {
        Role::Equality => value.abs() * row.scale / row.level,
        Role::Inequality { .. } => value.max(0.0) * row.scale / row.level,
        Role::Cost { .. } => 0.0,
    }
}

/// Index of the worst constraint row, and its residual-to-tolerance ratio.
pub fn worst(rows: &Rows) -> (usize, f64) {
    rows.iter()
        .enumerate()
        .map(|(index, (row, value))| (index, level(row, value)))
        .fold((0, 0.0), |worst, this| if this.1 > worst.1 { this } else { worst })
}

/// Worst level of the rows that no unknown changes, such as those of a transition's first and last sample, whose states belong to
/// other plans. `rows` must contain derivatives.
pub fn fixed_level(rows: &Rows) -> f64 {
    let is_fixed = |row: &Row| rows.derivatives[row.entries.clone()].iter().all(|d| *d == 0.0);
    let levels = rows.iter().map(|(row, value)| (row, level(row, value)));
    levels.filter(|(row, level)| *level > 0.0 && is_fixed(row)).map(|of| of.1).fold(0.0, f64::max)
}
