//! Optimum at the end of the multiplier iteration, found to rounding by Newton's method, and its derivatives with respect to
//! its rows (thesis 2.5.1, by the implicit function theorem).
//!
//! Multipliers s end at a fixed point. With φ(x) = x for equalities and φ = ψ′_ε/2 for inequalities, the fixed point is
//!
//! ```text
//! G = Σ_costs 2w r∇r + Σ 2ρ s∇g = 0        Φ = φ(g + s) − s = 0
//! ```
//!
//! Active inequalities are thus inside the band of ψ, and the conditions are smooth. With A = ∇g and b = φ′(g + s), their
//! derivatives are
//!
//! ```text
//! J = [ H   2ρAᵀ  ]     H = Σ_costs 2w (∇r∇rᵀ + r∇²r) + Σ 2ρ s∇²g
//!     [ bA  b − 1 ]
//! ```
//!
//! Second derivatives matter: without them, predicted changes of a design are wrong by 5 to 100 %. They are not assembled.
//! Conjugate gradients use products H·v, differences of the exact G at fixed multipliers. The preconditioner is the factor of
//! the Gauss-Newton matrix with stiff constraints. Refinement corrects the error of the finite stiffness.

use super::normal::{NormalEquations, row_energy};
use crate::formulation::rows::{Columns, Role, Row, Rows};

/// Maximum stiffness b/(1 − b) of a constraint in the preconditioner, in units of its penalty. From 1000 on, rounding has an
/// effect.
const STIFFNESS_MAX: f64 = 100.0;
/// Damping of the preconditioner, for unknowns that only second derivatives determine.
const DAMPING: f64 = 1e-7;
/// Largest step of a central difference, scaled variables. Rows have radii of curvature of 0.1 and more.
const DIFFERENCE: f64 = 2e-5;
/// Accuracy of derivatives.
const DERIVATIVE: Effort = Effort { leave: 1e-9, products: 120, refinements: 10, curvature: 1.0 };
/// Accuracy of steps towards the optimum. Each step corrects the error of the previous one.
const STEP: Effort = Effort { leave: 1e-3, products: 60, refinements: 3, curvature: 1.0 };
/// Number of consecutive stalled Newton steps after which the method gives up.
const STALLED: usize = 3;
/// Ratio of the squares of the conditions after and before a Newton step, above which the step counts as stalled.
const HARDLY: f64 = 0.8;
/// Fractions of the second derivatives that steps use, in order of trial. Away from the optimum, the Hessian may be indefinite.
const CURVATURES: [f64; 3] = [1.0, 0.5, 0.0];
/// Sum of the squares of the conditions, in units of energy, below which they are rounding errors.
const ROUNDING: f64 = 1e-17;
/// Length of a step below which the conditions are rounding errors, scaled variables. Products from differences are inexact.
const NEARLY_NO_STEP: f64 = 1e-5;
/// Fractions of a Newton step, in order of trial.
const SHARES: [f64; 6] = [1.0, 0.5, 0.25, 0.1, 0.03, 0.01];

/// Rows as functions of a step from a base point, in scaled variables.
pub trait Residuals {
    /// Columns of the unknowns.
    fn columns(&self) -> &Columns;
    /// Penalty of every constraint.
    fn penalty(&self) -> f64;
    /// Returns the rows after a step. Rows that contribute to the energy with these multipliers have derivatives.
    fn rows(&self, step: &[f64], shifts: &[f64], reuse: Rows) -> Rows;
}

/// Conditions of an optimum, zero there: G for every unknown, Φ for every row.
#[derive(Clone, Debug, PartialEq)]
pub struct Conditions {
    /// Condition G.
    pub gradient: Vec<f64>,
    /// Condition Φ, 0 for costs.
    pub fixed_point: Vec<f64>,
}

impl Conditions {
    /// Computes the conditions of rows with multipliers.
    pub fn of(rows: &Rows, shifts: &[f64], penalty: f64, columns: usize) -> Self {
        let slopes = slopes(rows, shifts, penalty);
        let fixed_point = rows.iter().zip(shifts).map(|((row, value), &shift)| match row.role {
            Role::Cost { .. } => 0.0,
            _ => row_energy(row, value, shift, 1.0)[1] / 2.0 - shift,
        });
        Self {
            gradient: weighted(rows, shifts, &slopes, columns),
            fixed_point: fixed_point.collect(),
        }
    }

    /// Returns `(self − other) · by`.
    pub fn minus(mut self, other: &Self, by: f64) -> Self {
        let difference = |one: &mut Vec<f64>, other: &[f64]| {
            one.iter_mut().zip(other).for_each(|(one, other)| *one = (*one - other) * by);
        };
        difference(&mut self.gradient, &other.gradient);
        difference(&mut self.fixed_point, &other.fixed_point);
        self
    }

    /// Returns the sum of the products of all entries.
    pub fn dot(&self, other: &Self) -> f64 {
        dot(&self.gradient, &other.gradient) + dot(&self.fixed_point, &other.fixed_point)
    }

    fn negated(&self) -> Self {
        let negated = |of: &[f64]| of.iter().map(|x| -x).collect();
        Self { gradient: negated(&self.gradient), fixed_point: negated(&self.fixed_point) }
    }

    /// Squared distance from an optimum, in units of energy.
    fn squares(&self, penalty: f64) -> f64 {
        dot(&self.gradient, &self.gradient) / penalty
            + penalty * dot(&self.fixed_point, &self.fixed_point)
    }
}

/// Change of an optimum.
#[derive(Clone, Debug, PartialEq)]
pub struct Change {
    /// Change of the unknowns, scaled variables.
    pub unknowns: Vec<f64>,
    /// Change of the multipliers, as shifts of the rows.
    pub shifts: Vec<f64>,
}

impl Change {
    fn plus(&self, share: f64, other: &Self) -> Self {
        Self {
            unknowns: along(&self.unknowns, share, &other.unknowns),
            shifts: along(&self.shifts, share, &other.shifts),
        }
    }
}

/// Second derivatives that enter the differentiation of an optimum.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Curvature {
    /// Complete second derivatives: changes of the optimum are exact.
    Full,
    /// Second derivatives of the Gauss-Newton matrix, which is positive definite, so that changes are estimates. Used if
    /// Newton's method does not reach the optimum of a plan, or if the Hessian of the Lagrangian is not positive definite
    /// along the constraints.
    GaussNewton,
}

/// Reason why there is no optimum, or no derivative of it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum NoOptimum {
    /// Newton's method does not converge.
    Diverges,
    /// The energy is not minimal: it falls in some direction along the constraints.
    Saddle,
}

/// Accuracy and limits of the solution of a linear system.
#[derive(Clone, Copy)]
struct Effort {
    /// Relative residual at which conjugate gradients stop, and relative change at which refinement ends.
    leave: f64,
    /// Maximum number of products with the Hessian per run of conjugate gradients.
    products: usize,
    /// Maximum number of solutions that refinement adds up.
    refinements: usize,
    /// Fraction of the second derivatives in the matrix.
    curvature: f64,
}

/// Optimum, or point near one.
pub struct Optimum<'a> {
    residuals: &'a dyn Residuals,
    /// Point, as a step from the base point.
    position: Vec<f64>,
    rows: Rows,
    shifts: Vec<f64>,
    /// Unit vector of the direction that the rows do not determine. Steps have no component along it.
    pin: Option<Vec<f64>>,
    normal: NormalEquations,
    /// Factors b and 1 − b of every constraint; 1 − b is bounded by the maximum stiffness.
    slack: Vec<[f64; 2]>,
}

impl<'a> Optimum<'a> {
    /// Begins at the base point, with multipliers. `pin` is a unit vector along which the point is fixed.
    pub fn near(
        residuals: &'a dyn Residuals,
        mut shifts: Vec<f64>,
        pin: Option<Vec<f64>>,
    ) -> Result<Self, NoOptimum> {
        let position = vec![0.0; residuals.columns().count];
        let rows = residuals.rows(&position, &shifts, Rows::default());
        drop_idle(&rows, &mut shifts);
        let normal = NormalEquations::new(&rows, residuals.columns());
        let slack = Vec::new();
        let mut here = Self { residuals, position, rows, shifts, pin, normal, slack };
        here.factorise()?;
        Ok(here)
    }

    /// Moves to the optimum by Newton's method, until a step is shorter than `length`.
    ///
    /// # Errors
    /// Returns an error if the optimum is not reached in `steps` steps, or if three consecutive steps hardly approach it.
    pub fn polish(&mut self, steps: usize, length: f64) -> Result<(), NoOptimum> {
        let (mut stalled, mut previous, mut last) = (0, f64::INFINITY, f64::INFINITY);
        for _ in 0..steps {
            let here = self.conditions(&self.rows, &self.shifts);
            let before = here.squares(self.penalty());
            // Near the end, rounding decides.
            let is_there = |last: f64| before < ROUNDING || last < NEARLY_NO_STEP;
            stalled = if before > HARDLY * previous { stalled + 1 } else { 0 };
            if stalled == STALLED {
                return if is_there(last) { Ok(()) } else { Err(NoOptimum::Diverges) };
            }
            previous = before;
            let step = CURVATURES
                .into_iter()
                .find_map(|curvature| self.solve(&here, Effort { curvature, ..STEP }).ok());
            let Some(step) = step else { return Err(NoOptimum::Saddle) };
            last = norm(&step.unknowns);
            if !self.take(&step, before) {
                return if is_there(last) { Ok(()) } else { Err(NoOptimum::Diverges) };
            }
            self.factorise()?;
            if last < length {
                return Ok(());
            }
        }
        Err(NoOptimum::Diverges)
    }

    /// Takes the largest fraction of a step that brings the conditions nearer to zero. Returns false if no fraction does.
    fn take(&mut self, step: &Change, before: f64) -> bool {
        for share in SHARES {
            let position = along(&self.position, share, &step.unknowns);
            let mut shifts = along(&self.shifts, share, &step.shifts);
            for (row, shift) in self.rows.rows.iter().zip(&mut shifts) {
                if matches!(row.role, Role::Inequality { .. }) {
                    *shift = shift.max(0.0);
                }
            }
            let rows = self.evaluate(&position, &shifts);
            drop_idle(&rows, &mut shifts);
            if self.conditions(&rows, &shifts).squares(self.penalty()) < before {
                (self.position, self.rows, self.shifts) = (position, rows, shifts);
                return true;
            }
        }
        false
    }

    /// Returns the point, as a step from the base point.
    pub fn position(&self) -> &[f64] {
        &self.position
    }

    /// Returns the rows at the point.
    pub fn rows(&self) -> &Rows {
        &self.rows
    }

    /// Returns the multipliers, as shifts of the rows.
    pub fn shifts(&self) -> &[f64] {
        &self.shifts
    }

    /// Conditions of an optimum for rows with the pattern of this point's rows.
    pub fn conditions(&self, rows: &Rows, shifts: &[f64]) -> Conditions {
        Conditions::of(rows, shifts, self.penalty(), self.position.len())
    }

    /// Change of the optimum for a change of its conditions: −J⁻¹·`conditions`.
    ///
    /// # Errors
    /// Returns an error if the point is not a minimum.
    pub fn change(
        &self,
        conditions: &Conditions,
        curvature: Curvature,
    ) -> Result<Change, NoOptimum> {
        let curvature = match curvature {
            Curvature::Full => 1.0,
            Curvature::GaussNewton => 0.0,
        };
        self.solve(conditions, Effort { curvature, ..DERIVATIVE })
    }

    /// Solves −J⁻¹·`conditions`: first with stiff constraints, then by generalised conjugate residuals for the rest.
    fn solve(&self, conditions: &Conditions, effort: Effort) -> Result<Change, NoOptimum> {
        let right = conditions.negated();
        let mut sum = self.solve_stiff(&right, effort)?;
        let enough = effort.leave * norm(&sum.unknowns);
        // The first rows of the system hold exactly, so only Φ remains.
        let mut left = self.left_by(&sum);
        let mut known: Vec<(Change, Vec<f64>)> = Vec::new();
        for _ in 1..effort.refinements {
            let gradient = vec![0.0; sum.unknowns.len()];
            let right = Conditions { gradient, fixed_point: left.clone() };
            let mut step = self.solve_stiff(&right, effort)?;
            let mut image = along(&left, -1.0, &self.left_by(&step));
            for (other, of_other) in &known {
                let part = -dot(&image, of_other) / dot(of_other, of_other);
                step = step.plus(part, other);
                image = along(&image, part, of_other);
            }
            let squares = dot(&image, &image);
            if squares == 0.0 {
                break;
            }
            let share = dot(&left, &image) / squares;
            sum = sum.plus(share, &step);
            left = along(&left, -share, &image);
            if share.abs() * norm(&step.unknowns) <= enough {
                break;
            }
            known.push((step, image));
        }
        Ok(sum)
    }

    /// Residual of Φ after a solution with stiff constraints.
    fn left_by(&self, step: &Change) -> Vec<f64> {
        let left = |(shift, [b, open]): (&f64, &[f64; 2])| {
            if *b > 0.0 { (1.0 - b - open) * shift } else { 0.0 }
        };
        step.shifts.iter().zip(&self.slack).map(left).collect()
    }

    /// Adjoint (y, z) of an objective with the given gradient. Through the optimum, the objective changes by −y·∂G/∂p − z·∂Φ/∂p
    /// per unit of a parameter p.
    ///
    /// # Errors
    /// Returns an error if the point is not a minimum.
    pub fn adjoint(&self, gradient: &[f64], curvature: Curvature) -> Result<Conditions, NoOptimum> {
        let fixed_point = vec![0.0; self.shifts.len()];
        let conditions =
            Conditions { gradient: gradient.iter().map(|g| -g).collect(), fixed_point };
        let Change { unknowns, shifts } = self.change(&conditions, curvature)?;
        let scaled = shifts.iter().zip(&self.slack);
        let of_row = |(shift, [b, _]): (&f64, &[f64; 2])| {
            if *b > 0.0 { shift * 2.0 * self.penalty() / b } else { 0.0 }
        };
        Ok(Conditions { fixed_point: scaled.map(of_row).collect(), gradient: unknowns })
    }

    fn penalty(&self) -> f64 {
        self.residuals.penalty()
    }

    fn evaluate(&self, position: &[f64], shifts: &[f64]) -> Rows {
        self.residuals.rows(position, shifts, Rows::default())
    }

    /// Factorises the preconditioner at the present point.
    fn factorise(&mut self) -> Result<(), NoOptimum> {
        let penalty = self.penalty();
        let slack =
            self.rows.iter().zip(&self.shifts).map(|((row, value), &shift)| match row.role {
                Role::Cost { .. } => [0.0, 1.0],
                _ if !row.counts(value + shift) => [0.0, 1.0],
                _ => {
                    let b = row_energy(row, value, shift, 1.0)[2] / 2.0;
                    [b, (1.0 - b).max(b / STIFFNESS_MAX)]
                }
            });
        self.slack = slack.collect();
        let slack = &self.slack;
        self.normal.assemble_weighted(&self.rows, |index, row| match row.role {
            Role::Cost { weight } => Some([0.0, 2.0 * weight]),
            _ => {
                let [b, open] = slack[index];
                (b > 0.0).then_some([0.0, 2.0 * penalty * b / open])
            }
        });
        self.normal.factorise(DAMPING).ok_or(NoOptimum::Saddle)
    }

    /// Solves J·x = `right` with bounded stiffness.
    fn solve_stiff(&self, right: &Conditions, effort: Effort) -> Result<Change, NoOptimum> {
        let penalty = self.penalty();
        let pull: Vec<f64> = self
            .slack
            .iter()
            .zip(&right.fixed_point)
            .map(|([b, open], right)| if *b > 0.0 { 2.0 * penalty * right / open } else { 0.0 })
            .collect();
        let mut gradient = weighted(&self.rows, &self.shifts, &pull, self.position.len());
        gradient.iter_mut().zip(&right.gradient).for_each(|(g, right)| *g += right);
        let unknowns = self.conjugate_gradients(gradient, effort)?;
        let shifts = self
            .rows
            .rows
            .iter()
            .enumerate()
            .map(|(index, row)| {
                let [b, open] = self.slack[index];
                match row.role {
                    Role::Cost { .. } => 0.0,
                    _ if b > 0.0 => {
                        (b * change_of(&self.rows, row, &unknowns) - right.fixed_point[index])
                            / open
                    }
                    _ => -right.fixed_point[index],
                }
            })
            .collect();
        Ok(Change { unknowns, shifts })
    }

    /// Solves (H + 2ρΣ b/(1−b) AᵀA)·x = `right`.
    fn conjugate_gradients(
        &self,
        mut right: Vec<f64>,
        effort: Effort,
    ) -> Result<Vec<f64>, NoOptimum> {
        self.without_pin(&mut right);
        let mut x = vec![0.0; right.len()];
        let preconditioned = |right: &[f64]| {
            let mut step = right.to_vec();
            self.normal.solve(&mut step);
            self.without_pin(&mut step);
            step
        };
        let mut z = preconditioned(&right);
        let mut direction = z.clone();
        let mut size = dot(&right, &z);
        let enough = size * effort.leave * effort.leave;
        for _ in 0..effort.products {
            if size <= enough {
                break;
            }
            let product = self.product(&direction, effort.curvature);
            let curvature = dot(&direction, &product);
            if curvature.is_nan() || curvature <= 0.0 {
                return Err(NoOptimum::Saddle);
            }
            let share = size / curvature;
            x = along(&x, share, &direction);
            right = along(&right, -share, &product);
            z = preconditioned(&right);
            let next = dot(&right, &z);
            direction = along(&z, next / size, &direction);
            size = next;
        }
        Ok(x)
    }

    /// Product (H + 2ρΣ b/(1−b) AᵀA)·v.
    fn product(&self, v: &[f64], curvature: f64) -> Vec<f64> {
        let penalty = self.penalty();
        let Self { rows, shifts, position, slack, .. } = self;
        let pulls: Vec<f64> = rows
            .rows
            .iter()
            .zip(slack)
            .map(|(row, [b, open])| match row.role {
                Role::Cost { weight } => 2.0 * weight * change_of(rows, row, v),
                _ if *b > 0.0 => 2.0 * penalty * b / open * change_of(rows, row, v),
                _ => 0.0,
            })
            .collect();
        let mut product = weighted(rows, shifts, &pulls, v.len());
        self.without_pin(&mut product);
        if curvature == 0.0 {
            return product;
        }
        let slopes = slopes(rows, shifts, penalty);
        let length = difference_length(v);
        let [ahead, behind] = [length, -length].map(|length| {
            let rows = self.evaluate(&along(position, length, v), shifts);
            weighted(&rows, shifts, &slopes, v.len())
        });
        for ((product, ahead), behind) in product.iter_mut().zip(ahead).zip(behind) {
            *product += curvature * (ahead - behind) / (2.0 * length);
        }
        self.without_pin(&mut product);
        product
    }

    /// Removes the component along the pinned direction from a vector.
    fn without_pin(&self, vector: &mut [f64]) {
        if let Some(pin) = &self.pin {
            let part = dot(pin, vector);
            vector.iter_mut().zip(pin).for_each(|(v, pin)| *v -= part * pin);
        }
    }
}

/// Sets the multipliers of rows that do not contribute to the energy to 0.
fn drop_idle(rows: &Rows, shifts: &mut [f64]) {
    for ((row, value), shift) in rows.iter().zip(shifts) {
        if matches!(row.role, Role::Cost { .. }) || !row.counts(value + *shift) {
            *shift = 0.0;
        }
    }
}

/// Derivatives ∂(energy)/∂r of every row: 2w r for costs, 2ρ s for constraints.
fn slopes(rows: &Rows, shifts: &[f64], penalty: f64) -> Vec<f64> {
    let slope = |((row, value), shift): ((&Row, f64), &f64)| match row.role {
        Role::Cost { weight } => 2.0 * weight * value,
        _ => 2.0 * penalty * shift,
    };
    rows.iter().zip(shifts).map(slope).collect()
}

/// Sum Σ slope·∇r over the rows that contribute to the energy.
pub(super) fn weighted(rows: &Rows, shifts: &[f64], slopes: &[f64], columns: usize) -> Vec<f64> {
    let mut sum = vec![0.0; columns];
    for (((row, value), &shift), &slope) in rows.iter().zip(shifts).zip(slopes) {
        if slope != 0.0 && row.counts(value + shift) {
            let entries = row.entries.clone();
            entries.for_each(|k| sum[rows.columns[k]] += slope * rows.derivatives[k]);
        }
    }
    sum
}

/// Step along a direction, as a fraction of the direction, for finite differences of Hessian products.
pub(super) fn difference_length(v: &[f64]) -> f64 {
    DIFFERENCE / v.iter().fold(f64::MIN_POSITIVE, |most, x| x.abs().max(most))
}

/// Product ∇r·v.
pub(super) fn change_of(rows: &Rows, row: &Row, v: &[f64]) -> f64 {
    row.entries.clone().map(|k| rows.derivatives[k] * v[rows.columns[k]]).sum()
}

pub(super) fn along(from: &[f64], share: f64, step: &[f64]) -> Vec<f64> {
    from.iter().zip(step).map(|(from, step)| from + share * step).collect()
}

pub(super) fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

fn norm(a: &[f64]) -> f64 {
    dot(a, a).sqrt()
}

#[cfg(test)]
pub(super) mod tests;
