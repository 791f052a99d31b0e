//! Minimum of the energy for given multipliers, to rounding, by Newton's method with the true Hessian.
//!
//! An infeasible request has no optimum with multipliers: they grow without bound. The energy for given multipliers has a
//! minimum with remaining violations. By the envelope theorem, the derivative of the minimum with respect to a parameter is the
//! derivative of the energy at fixed unknowns. This requires a true minimum. With large residuals, the Gauss-Newton matrix
//! lacks their curvature, and Gauss-Newton stops far from the minimum.
//!
//! The Hessian may be indefinite before the minimum. Steps come from conjugate gradients in a trust region (Steihaug 1983; the
//! recurrences for lengths: Conn, Gould, Toint 2000, sec. 7.5.1). The Gauss-Newton matrix is the preconditioner and the metric
//! of the region, so that the square of its radius is an energy.

use super::normal::{NormalEquations, row_energy};
use super::optimum::{NoOptimum, Residuals, along, change_of, difference_length, dot, weighted};
use crate::formulation::rows::{Role, Row, Rows};

/// Damping of the preconditioner, which bounds steps to the lengths that the weakest costs, 1e-3 and more, allow.
const DAMPING: f64 = 1e-4;
/// Maximum number of products of conjugate gradients.
const PRODUCTS_MAX: usize = 150;
/// Bounds of the relative residual at which conjugate gradients stop. Near the minimum, this residual shrinks with the remaining
/// energy.
const LEAVE: [f64; 2] = [1e-7, 0.2];
/// Relative residual at which conjugate gradients stop when they compute derivatives.
const DERIVATIVE: f64 = 1e-5;
/// Fraction of the predicted decrease below which a step is bent along curved constraints, as in Gauss-Newton.
const BEND_BELOW: f64 = 0.25;
/// Predicted decrease at which the minimum is reached, as a fraction of the energy.
const REACHED: f64 = 1e-15;
/// Predicted decrease at which the minimum is reached if rounding prevents any step, as a fraction of the energy.
const ROUNDING: f64 = 1e-11;

/// Point on the path to the minimum energy, or at the minimum.
pub struct Minimum<'a> {
    residuals: &'a dyn Residuals,
    position: Vec<f64>,
    rows: Rows,
    shifts: Vec<f64>,
    pin: Option<Vec<f64>>,
    normal: NormalEquations,
    energy: f64,
    /// Square of the trust region's radius.
    trusted: f64,
}

/// Step in the trust region.
struct Step {
    step: Vec<f64>,
    /// Decrease of the energy that the quadratic model predicts.
    promised: f64,
    /// Square of the step's length in the metric of the region.
    square: f64,
    /// True if the step ends at the boundary of the region.
    is_cut: bool,
}

/// Trial point.
struct TrialPoint {
    position: Vec<f64>,
    rows: Rows,
    energy: f64,
}

impl<'a> Minimum<'a> {
    /// Begins at the base point with multipliers, which are constant. `pin` is a unit vector along which the point is fixed.
    pub fn near(
        residuals: &'a dyn Residuals,
        shifts: Vec<f64>,
        pin: Option<Vec<f64>>,
    ) -> Result<Self, NoOptimum> {
        let position = vec![0.0; residuals.columns().count];
        let rows = residuals.rows(&position, &shifts, Rows::default());
        let normal = NormalEquations::new(&rows, residuals.columns());
        let energy = NormalEquations::energy(&rows, &shifts, residuals.penalty());
        let mut here =
            Self { residuals, position, rows, shifts, pin, normal, energy, trusted: energy };
        here.linearise()?;
        Ok(here)
    }

    /// Takes a step of Newton's method. Returns true if the minimum has been reached, so that no step is needed.
    ///
    /// # Errors
    /// Returns an error if no step lowers the energy.
    pub fn step(&mut self) -> Result<bool, NoOptimum> {
        loop {
            let Step { step, promised, square, is_cut } = self.trial();
            if promised <= REACHED * self.energy {
                return Ok(true);
            }
            let mut there = self.at(&step);
            if self.energy - there.energy < BEND_BELOW * promised {
                let bend = self.normal.bend(&self.rows, &there.rows, &step);
                // A correction longer than the step shows that the rows are too curved for it to be valid.
                if let Some(bend) = bend.filter(|bend| dot(bend, bend) <= dot(&step, &step)) {
                    let bent = self.at(&along(&step, 1.0, &bend));
                    there = if bent.energy < there.energy { bent } else { there };
                }
            }
            let kept = (self.energy - there.energy) / promised;
            if kept > 0.75 && is_cut {
                self.trusted *= 9.0;
            } else if kept.is_nan() || kept < 0.25 {
                self.trusted = square.min(self.trusted) / 16.0;
            }
            if kept > 1e-3 {
                (self.position, self.rows, self.energy) =
                    (there.position, there.rows, there.energy);
                self.linearise()?;
                return Ok(false);
            }
            if promised <= ROUNDING * self.energy {
                return Ok(true);
            }
            if self.trusted <= f64::MIN_POSITIVE {
                return Err(NoOptimum::Diverges);
            }
        }
    }

    fn at(&self, step: &[f64]) -> TrialPoint {
        let position = along(&self.position, 1.0, step);
        let rows = self.residuals.rows(&position, &self.shifts, Rows::default());
        let energy = NormalEquations::energy(&rows, &self.shifts, self.residuals.penalty());
        TrialPoint { position, rows, energy }
    }

    /// Returns the energy at the point.
    pub fn energy(&self) -> f64 {
        self.energy
    }

    /// Returns the point, as a step from the base point.
    pub fn position(&self) -> &[f64] {
        &self.position
    }

    /// Returns the rows at the point.
    pub fn rows(&self) -> &Rows {
        &self.rows
    }

    /// Gradient of the energy of rows with the same pattern, at the same multipliers.
    pub fn gradient_of(&self, rows: &Rows) -> Vec<f64> {
        let slopes = slopes(rows, &self.shifts, self.residuals.penalty());
        weighted(rows, &self.shifts, &slopes, self.position.len())
    }

    /// Multipliers equivalent to the violations, as shifts of the rows.
    pub fn multipliers(&self) -> Vec<f64> {
        let penalty = self.residuals.penalty();
        let shift = |(row, slope): (&Row, f64)| match row.role {
            Role::Cost { .. } => 0.0,
            _ => slope / (2.0 * penalty),
        };
        self.rows.rows.iter().zip(slopes(&self.rows, &self.shifts, penalty)).map(shift).collect()
    }

    /// Change of the minimum for a change of the gradient: −H⁻¹·`gradient`.
    ///
    /// # Errors
    /// Returns an error if the Hessian is not positive definite.
    pub fn change(&self, gradient: &[f64]) -> Result<Vec<f64>, NoOptimum> {
        let Step { step, is_cut, .. } = self.truncated(gradient, f64::INFINITY, DERIVATIVE);
        if is_cut { Err(NoOptimum::Saddle) } else { Ok(step) }
    }

    /// Factorises the preconditioner and computes the gradient at the present point.
    fn linearise(&mut self) -> Result<(), NoOptimum> {
        self.normal.assemble(&self.rows, &self.shifts, self.residuals.penalty());
        self.normal.factorise(DAMPING).ok_or(NoOptimum::Diverges)
    }

    fn trial(&self) -> Step {
        let mut gradient = self.normal.gradient.clone();
        self.without_pin(&mut gradient);
        let size = dot(&gradient, &self.preconditioned(&gradient));
        let leave = (size / self.energy).sqrt().clamp(LEAVE[0], LEAVE[1]);
        self.truncated(&gradient, self.trusted, leave)
    }

    fn preconditioned(&self, right: &[f64]) -> Vec<f64> {
        let mut step = right.to_vec();
        self.normal.solve(&mut step);
        self.without_pin(&mut step);
        step
    }

    /// Minimises g·x + ½ x·Hx over steps of limited length, by conjugate gradients. The iterations end at the relative residual
    /// `leave`.
    fn truncated(&self, gradient: &[f64], trusted: f64, leave: f64) -> Step {
        let mut left = gradient.to_vec();
        self.without_pin(&mut left);
        let mut z = self.preconditioned(&left);
        let mut direction: Vec<f64> = z.iter().map(|z| -z).collect();
        let mut size = dot(&left, &z);
        let enough = size * leave * leave;
        let mut found =
            Step { step: vec![0.0; left.len()], promised: 0.0, square: 0.0, is_cut: false };
        // Products in the metric: step times direction, and direction times itself.
        let (mut across, mut own) = (0.0, size);
        for _ in 0..PRODUCTS_MAX {
            if size <= enough || size <= 0.0 {
                break;
            }
            let product = self.product(&direction);
            let curvature = dot(&direction, &product);
            let share = size / curvature;
            let square = found.square + share * (2.0 * across + share * own);
            if curvature <= 0.0 || square >= trusted {
                found.is_cut = true;
                if trusted.is_finite() {
                    let room = across * across + own * (trusted - found.square);
                    let share = (room.max(0.0).sqrt() - across) / own;
                    found.step = along(&found.step, share, &direction);
                    found.promised += share * (size - 0.5 * share * curvature);
                    found.square = trusted;
                }
                break;
            }
            found.step = along(&found.step, share, &direction);
            found.promised += 0.5 * share * size;
            found.square = square;
            left = along(&left, share, &product);
            z = self.preconditioned(&left);
            let next = dot(&left, &z);
            let beta = next / size;
            direction = direction.iter().zip(&z).map(|(d, z)| beta * d - z).collect();
            across = beta * (across + share * own);
            own = next + beta * beta * own;
            size = next;
        }
        found
    }

    /// Product H·v. Second derivatives of the rows are finite differences of gradients at fixed slopes.
    fn product(&self, v: &[f64]) -> Vec<f64> {
        let penalty = self.residuals.penalty();
        let Self { rows, shifts, position, .. } = self;
        let pull = |((row, value), &shift): ((&Row, f64), &f64)| {
            if !row.counts(value + shift) {
                return 0.0;
            }
            row_energy(row, value, shift, penalty)[2] * change_of(rows, row, v)
        };
        let pulls: Vec<f64> = rows.iter().zip(shifts).map(pull).collect();
        let mut product = weighted(rows, shifts, &pulls, v.len());
        let slopes = slopes(rows, shifts, penalty);
        let length = difference_length(v);
        let [ahead, behind] = [length, -length].map(|length| {
            let rows = self.residuals.rows(&along(position, length, v), shifts, Rows::default());
            weighted(&rows, shifts, &slopes, v.len())
        });
        for ((product, ahead), behind) in product.iter_mut().zip(ahead).zip(behind) {
            *product += (ahead - behind) / (2.0 * length);
        }
        self.without_pin(&mut product);
        product
    }

    fn without_pin(&self, vector: &mut [f64]) {
        if let Some(pin) = &self.pin {
            let part = dot(pin, vector);
            vector.iter_mut().zip(pin).for_each(|(v, pin)| *v -= part * pin);
        }
    }
}

/// Derivatives ∂(energy)/∂r of every row.
fn slopes(rows: &Rows, shifts: &[f64], penalty: f64) -> Vec<f64> {
    let slope = |((row, value), &shift): ((&Row, f64), &f64)| match row.role {
        Role::Inequality { .. } if !row.counts(value + shift) => 0.0,
        _ => row_energy(row, value, shift, penalty)[1],
    };
    rows.iter().zip(shifts).map(slope).collect()
}

#[cfg(test)]
mod tests {
    use super::super::optimum::tests::Toy;
    use super::*;

    const CONTRADICTION: [Role; 2] = [Role::Equality, Role::Cost { weight: 1.0 }];

    /// Toy problem (x² + 1)² + (x − a)². Its Gauss-Newton matrix is 2 at 0, where the Hessian is 6.
    fn contradiction(a: f64) -> impl Fn(&[f64]) -> Vec<(f64, Vec<f64>)> {
        move |m: &[f64]| vec![(m[0] * m[0] + 1.0, vec![2.0 * m[0]]), (m[0] - a, vec![1.0])]
    }

    #[test]
    fn a_violation_that_cannot_end_is_least_where_the_closed_form_says() {
        // The real root of 4x³ + 6x = 2a, by Cardano.
        let least = |a: f64| {
            let half = a / 4.0;
            let root = (half * half + 0.125).sqrt();
            (root + half).cbrt() - (root - half).cbrt()
        };
        let a = 0.3;
        let rows = contradiction(a);
        let toy = Toy::new(&[0.9], 1.0, &CONTRADICTION, &rows);
        let mut minimum = Minimum::near(&toy, vec![0.0; 2], None).unwrap();
        let steps = (0..20).position(|_| minimum.step().unwrap()).unwrap();
        let at = 0.9 + minimum.position()[0];
        assert!((at - least(a)).abs() < 1e-9 && steps <= 8, "{at} {} {steps}", least(a));
        assert!((minimum.energy() - ((at * at + 1.0).powi(2) + (at - a).powi(2))).abs() < 1e-12);
        // ∂G/∂a = −2.
        let change = minimum.change(&[-2.0]).unwrap()[0];
        let difference = (least(a + 1e-5) - least(a - 1e-5)) / 2e-5;
        assert!((change - difference).abs() < 1e-8, "{change} {difference}");
    }

    #[test]
    fn a_saddle_is_left_downhill() {
        // (x² − 1)² + y²: a saddle at the origin, minima at x = ±1.
        let roles = [Role::Equality, Role::Cost { weight: 1.0 }];
        let rows =
            |m: &[f64]| vec![(m[0] * m[0] - 1.0, vec![2.0 * m[0], 0.0]), (m[1], vec![0.0, 1.0])];
        let toy = Toy::new(&[1e-3, 0.5], 1.0, &roles, &rows);
        let mut minimum = Minimum::near(&toy, vec![0.0; 2], None).unwrap();
        assert!((0..40).any(|_| minimum.step().unwrap()));
        let x = 1e-3 + minimum.position()[0];
        assert!((x - 1.0).abs() < 1e-9 && minimum.energy() < 1e-18, "{x}");
    }

    #[test]
    fn multipliers_are_what_the_violations_push_with() {
        // Twice ρ s ∇g balances 2w (x − a).
        let rows = contradiction(0.3);
        let toy = Toy::new(&[0.1], 1.0, &CONTRADICTION, &rows);
        let mut minimum = Minimum::near(&toy, vec![0.0; 2], None).unwrap();
        assert!((0..20).any(|_| minimum.step().unwrap()));
        let x = 0.1 + minimum.position()[0];
        let shifts = minimum.multipliers();
        assert!((shifts[0] - (x * x + 1.0)).abs() < 1e-12 && shifts[1] == 0.0);
        assert!((2.0 * shifts[0] * 2.0 * x + 2.0 * (x - 0.3)).abs() < 1e-9);
    }
}
