//! What a design is judged by, as functions of the rows of its plan, so that their derivatives are those of the rows.

use crate::families::Family;
use crate::formulation::rows::{Role, Row, Rows};

/// Exponent of the norm that stands for a largest value: a maximum has no derivative where two are equal.
const PEAK: i32 = 8;

/// What is to be small.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Objective {
    /// The costs in the energy of the plan.
    PlanCost,
    /// Speeds of all joints at all samples, as a mean of eighth powers, which follows the largest, rad/s.
    PeakJointSpeed,
    /// Torques of all joints at all samples, root mean square, N·m.
    JointTorque,
}

impl Objective {
    /// Its value.
    pub(super) fn value(self, rows: &Rows) -> f64 {
        match self {
            Self::PlanCost => self.terms(rows).map(|(_, term, _)| term).sum(),
            _ => {
                let (sum, count) = self.mean(rows);
                (sum / count).powf(1.0 / f64::from(self.exponent()))
            }
        }
    }

    /// Its gradient with respect to the scaled unknowns.
    pub(super) fn gradient(self, rows: &Rows, columns: usize) -> Vec<f64> {
        let outer = match self {
            Self::PlanCost => 1.0,
            _ => {
                let (sum, count) = self.mean(rows);
                let exponent = f64::from(self.exponent());
                if sum > 0.0 { (sum / count).powf(1.0 / exponent) / (exponent * sum) } else { 0.0 }
            }
        };
        let mut gradient = vec![0.0; columns];
        for (row, _, slope) in self.terms(rows) {
            for k in row.entries.clone() {
                gradient[rows.columns[k]] += outer * slope * rows.derivatives[k];
            }
        }
        gradient
    }

    fn exponent(self) -> i32 {
        if self == Self::PeakJointSpeed { PEAK } else { 2 }
    }

    fn mean(self, rows: &Rows) -> (f64, f64) {
        self.terms(rows).fold((0.0, 0.0), |(sum, count), (_, term, _)| (sum + term, count + 1.0))
    }

    /// Rows, their terms in the sum, and the derivatives of these with respect to the rows' values.
    fn terms(self, rows: &Rows) -> impl Iterator<Item = (&Row, f64, f64)> {
        rows.rows.iter().filter_map(move |row| match (self, row.role) {
            (Self::PlanCost, Role::Cost { weight }) => {
                Some((row, weight * row.value.powi(2), 2.0 * weight * row.value))
            }
            (Self::PeakJointSpeed, _) if row.family == Family::JointSpeed => Some(self.power(row)),
            (Self::JointTorque, _) if row.family == Family::JointTorque => Some(self.power(row)),
            _ => None,
        })
    }

    /// A power of what a row compares with its limit. Of the two rows of a speed one has it with its sign turned, and gives the
    /// same power.
    fn power(self, row: &Row) -> (&Row, f64, f64) {
        let limit = row.given.map_or(0.0, |given| -given.slope * given.value);
        let value = row.value * row.scale + limit;
        let n = self.exponent();
        (row, value.powi(n), f64::from(n) * value.powi(n - 1) * row.scale)
    }
}
