//! Prices of the constraints that limit a motion, from their multipliers.
//!
//! Let p be a value that constraints compare with. By the envelope theorem, the costs of the best plan change by `Σ λ ∂r/∂p`
//! per unit of p. No further solve is needed. An inactive constraint has no price.

use super::Optimal;
use crate::families::Family;
use crate::formulation::System;
use crate::formulation::rows::{Role, Row, Rows};
use crate::problem::{Problem, Unknowns};

/// Smallest price that is listed, as a fraction of the costs per percent of the field's value.
const WORTH: f64 = 1e-6;

/// Price of a constraint.
#[derive(Clone, Debug, PartialEq)]
pub struct Price {
    /// The constraint.
    pub family: Family,
    /// Field of the robot or motion file that the constraint compares with, and its value. `None` for constraints without a
    /// field.
    pub given: Option<(&'static str, f64)>,
    /// Names of the joints, links or end effectors at which the constraint raises the costs.
    pub subjects: Vec<String>,
    /// Change of the plan's costs per unit of the field's value. Without a field, change per unit by which the constraint is
    /// tightened, in the family's unit.
    pub per_unit: f64,
    /// Relative change of the costs per 1 % of the field's value; `None` without a field.
    pub per_percent: Option<f64>,
}

impl Optimal {
    /// Returns the prices of the active constraints that have an appreciable one, highest first. Equations without a field have
    /// none.
    pub fn prices(&self) -> Vec<Price> {
        of(&self.problem, &self.unknowns, &self.shifts)
    }
}

fn of(problem: &Problem, unknowns: &Unknowns, shifts: &[f64]) -> Vec<Price> {
    let system = System::selected(problem, Default::default());
    let rows = system.values(unknowns, Rows::default());
    let cost: f64 = rows.iter().map(cost).sum();
    let mut prices: Vec<Price> = Vec::new();
    for (index, (row, shift)) in rows.rows.iter().zip(shifts).enumerate() {
        let given = rows.given(index);
        let (is_limit, named) = (matches!(row.role, Role::Inequality { .. }), given.is_some());
        if *shift == 0.0 || matches!(row.role, Role::Cost { .. }) || !(is_limit || named) {
            continue;
        }
        let slope = given.map_or(1.0, |given| given.slope);
        let per_unit = 2.0 * system.penalty() * shift * slope / row.scale;
        let given = given.map(|given| (given.field, given.value));
        let same = |price: &&mut Price| price.family == row.family && price.given == given;
        let subject = row.subject.name(problem.model.robot());
        let price = match prices.iter_mut().find(same) {
            Some(price) => price,
            None => {
                let subjects = Vec::new();
                let new =
                    Price { family: row.family, given, subjects, per_unit: 0.0, per_percent: None };
                prices.push(new);
                prices.last_mut().expect("it was just added")
            }
        };
        price.per_unit += per_unit;
        if per_unit.abs() * row.scale > WORTH * cost
            && let Some(subject) = subject.filter(|subject| !price.subjects.contains(subject))
        {
            price.subjects.push(subject);
        }
    }
    for price in &mut prices {
        price.per_percent = price.given.map(|(_, value)| price.per_unit * 0.01 * value / cost);
    }
    let worth = |price: &Price| {
        // Relative to the tolerance, if the constraint is compared with 0.
        let relative = price.per_percent.unwrap_or_else(|| price.per_unit * 1e-3 / cost);
        relative.abs()
    };
    prices.retain(|price| worth(price) > WORTH);
    prices.sort_by(|a, b| worth(b).total_cmp(&worth(a)));
    prices
}

fn cost((row, value): (&Row, f64)) -> f64 {
    match row.role {
        Role::Cost { weight } => weight * value.powi(2),
        _ => 0.0,
    }
}
