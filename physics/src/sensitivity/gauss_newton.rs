//! Gauss–Newton method for sums of squares on rollouts (thesis 4.7.1), with a shift of the Hessian that grows after an
//! unsuccessful step.
//!
//! H is JᵀJ plus the Hessian of the penalties, which is SᵀO_qqS in the thesis. A step solves (H + λ diag H) Δp = −∇O. When
//! touch-downs move, the model is valid for small steps only. A larger λ shortens the step and turns it towards the gradient,
//! which a line search along one direction cannot. A rollout that fails, because a robot falls or a step does not converge,
//! counts as infinitely bad.

use crate::sensitivity::{Residual, Rollout};
use nalgebra::{DMatrix, DVector};

/// Residuals of a rollout at given parameters.
pub struct Evaluation {
    /// Values of the residuals.
    pub values: Vec<f64>,
    /// Computes the Jacobian of the residuals with respect to the parameters, one row for each residual. Called only for
    /// accepted steps.
    #[allow(clippy::type_complexity, reason = "the type has no other use")]
    pub jacobian: Box<dyn FnOnce() -> DMatrix<f64>>,
}

impl std::fmt::Debug for Evaluation {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Evaluation").field("values", &self.values).finish_non_exhaustive()
    }
}

impl From<(Rollout, Vec<Residual>)> for Evaluation {
    fn from((rollout, residuals): (Rollout, Vec<Residual>)) -> Self {
        let values = residuals.iter().map(|residual| residual.value).collect();
        Self { values, jacobian: Box::new(move || rollout.jacobian(&residuals)) }
    }
}

/// Residual of the parameters alone: Σ c p − target.
#[derive(Clone, Debug, PartialEq)]
pub struct Penalty {
    /// Indices of parameters, with their factors c.
    pub factors: Vec<(usize, f64)>,
    /// Target of the sum.
    pub target: f64,
}

impl Penalty {
    /// Penalises differences between adjacent knots of several curves. Parameters have the order of [`Control::of_all`]. β is
    /// the factor of the squares.
    ///
    /// [`Control::of_all`]: crate::sensitivity::parameter::Control::of_all
    pub fn smooth(curves: usize, knots: usize, periodic: bool, beta: f64) -> Vec<Self> {
        let weight = beta.sqrt();
        let pairs = (0..if periodic { knots } else { knots - 1 }).map(|k| (k, (k + 1) % knots));
        let of_pair = |(from, to): (usize, usize)| {
            (0..curves).map(move |curve| Self {
                factors: vec![(to * curves + curve, weight), (from * curves + curve, -weight)],
                target: 0.0,
            })
        };
        pairs.flat_map(of_pair).collect()
    }

    /// Penalises the first `parameters` parameters themselves. β is the factor of the squares.
    pub fn small(parameters: usize, beta: f64) -> Vec<Self> {
        let of = |k: usize| Self { factors: vec![(k, beta.sqrt())], target: 0.0 };
        (0..parameters).map(of).collect()
    }

    fn value(&self, parameters: &DVector<f64>) -> f64 {
        let sum: f64 = self.factors.iter().map(|&(k, factor)| factor * parameters[k]).sum();
        sum - self.target
    }
}

/// Stopping criteria and step limits.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Options {
    /// Maximum number of iterations, each with derivatives.
    pub iterations: usize,
    /// Smallest relative improvement of the objective in an iteration. The method also ends if the objective falls below
    /// `tolerance²` times its initial value.
    pub tolerance: f64,
    /// Maximum change of a parameter in an iteration.
    pub most: f64,
    /// Initial shift λ.
    pub shift: f64,
}

impl Default for Options {
    fn default() -> Self {
        Self { iterations: 30, tolerance: 1e-6, most: f64::INFINITY, shift: 1e-3 }
    }
}

/// Number of successive increases of the shift after which a minimum is assumed.
const TRIALS: u32 = 8;
/// Factor of the shift after an unsuccessful step; its inverse applies after a successful one.
const FACTOR: f64 = 10.0;
/// Lower bound of the diagonal entries in the shift, relative to the largest entry. A parameter without effect on any residual
/// has the entry 0.
const LEAST: f64 = 1e-9;

/// Result of the method.
#[derive(Clone, Debug)]
pub struct Fit {
    /// Best parameters.
    pub parameters: Vec<f64>,
    /// Objective ½ Σ e², including penalties: initially and after each iteration.
    pub costs: Vec<f64>,
    /// Number of rollouts, including failed ones.
    pub rollouts: usize,
    /// True if the final iteration improved the objective by less than the tolerance, no step improved it, or the objective is
    /// 0 to rounding.
    pub converged: bool,
    /// Matrix JᵀJ at the beginning of the final step, including penalties. If residuals are in units of their standard
    /// deviations, its inverse is the covariance of the parameters.
    pub hessian: DMatrix<f64>,
}

/// Smallest significant eigenvalue of a Hessian with unit diagonal, relative to the largest.
const ROUNDING: f64 = 1e-12;

impl Fit {
    /// Standard deviations of the parameters, if residuals are in units of their standard deviations. Infinite if the residuals
    /// do not determine a parameter, or a combination that includes it.
    pub fn deviations(&self) -> Vec<f64> {
        let scale = self.hessian.diagonal().map(f64::sqrt);
        let inverse = scale.map(|scale| if scale > 0.0 { 1.0 / scale } else { 0.0 });
        let scaled =
            DMatrix::from_diagonal(&inverse) * &self.hessian * DMatrix::from_diagonal(&inverse);
        let eigen = scaled.symmetric_eigen();
        let least = ROUNDING * eigen.eigenvalues.amax();
        let of = |k: usize| {
            if scale[k] == 0.0 {
                return f64::INFINITY;
            }
            let parts = eigen.eigenvectors.row(k);
            let variance = parts.iter().zip(&eigen.eigenvalues).map(|(part, value)| {
                let known = *value > least;
                let takes_part = part * part > ROUNDING;
                match (known, takes_part) {
                    (true, _) => part * part / value,
                    (false, true) => f64::INFINITY,
                    (false, false) => 0.0,
                }
            });
            variance.sum::<f64>().sqrt() / scale[k]
        };
        (0..scale.len()).map(of).collect()
    }
}

/// Minimises half the sum of squared residuals and penalties. `run` evaluates a rollout at given parameters; `None` if the
/// rollout fails.
///
/// Returns `None` if the rollout fails at the initial parameters.
pub fn minimise(
    start: &[f64],
    penalties: &[Penalty],
    options: &Options,
    mut run: impl FnMut(&[f64]) -> Option<Evaluation>,
) -> Option<Fit> {
    let mut at = DVector::from_column_slice(start);
    let cost = |values: &[f64], at: &DVector<f64>| {
        let of_penalties = penalties.iter().map(|penalty| penalty.value(at).powi(2));
        0.5 * (values.iter().map(|value| value * value).sum::<f64>() + of_penalties.sum::<f64>())
    };
    let mut evaluation = run(start)?;
    let mut fit = Fit {
        parameters: start.to_vec(),
        costs: vec![cost(&evaluation.values, &at)],
        rollouts: 1,
        converged: false,
        hessian: DMatrix::zeros(start.len(), start.len()),
    };
    let mut shift = options.shift;
    for _ in 0..options.iterations {
        let before = fit.costs[fit.costs.len() - 1];
        let values = DVector::from_vec(evaluation.values);
        let jacobian = (evaluation.jacobian)();
        fit.hessian = jacobian.tr_mul(&jacobian);
        let mut gradient = jacobian.tr_mul(&values);
        for penalty in penalties {
            let value = penalty.value(&at);
            for &(row, factor) in &penalty.factors {
                gradient[row] += factor * value;
                for &(column, other) in &penalty.factors {
                    fit.hessian[(row, column)] += factor * other;
                }
            }
        }
        let mut found = None;
        for _ in 0..TRIALS {
            let step = shifted_step(&fit.hessian, &gradient, shift);
            let step = step.map(|step| &step * (options.most / step.amax()).min(1.0));
            let trial = step.map(|step| &at + step);
            let trial = trial.filter(|trial| trial.iter().all(|part| part.is_finite()));
            if let Some(trial) = trial {
                fit.rollouts += 1;
                if let Some(evaluation) = run(trial.as_slice()) {
                    let cost = cost(&evaluation.values, &trial);
                    if cost < before {
                        found = Some((trial, evaluation, cost));
                        break;
                    }
                }
            }
            shift *= FACTOR;
        }
        let Some((trial, next, cost)) = found else {
            fit.converged = true;
            break;
        };
        shift /= FACTOR;
        (at, evaluation) = (trial, next);
        fit.parameters = at.as_slice().to_vec();
        fit.costs.push(cost);
        let rounding = options.tolerance * options.tolerance * fit.costs[0];
        if before - cost <= options.tolerance * before || cost <= rounding {
            fit.converged = true;
            break;
        }
    }
    Some(fit)
}

/// Step −(H + λ diag H)⁻¹ ∇O; `None` if the shifted Hessian is not positive definite.
fn shifted_step(
    hessian: &DMatrix<f64>,
    gradient: &DVector<f64>,
    shift: f64,
) -> Option<DVector<f64>> {
    let diagonal = hessian.diagonal();
    let least = LEAST * diagonal.amax().max(f64::MIN_POSITIVE);
    let mut shifted = hessian.clone();
    for (k, entry) in diagonal.iter().enumerate() {
        shifted[(k, k)] += shift * entry.max(least) + if *entry < least { least } else { 0.0 };
    }
    Some(-shifted.cholesky()?.solve(gradient))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Tests Rosenbrock's valley as a sum of squares, with a parameter without effect and a region in which rollouts fail.
    #[test]
    fn it_finds_the_end_of_a_bent_valley() {
        let run = |p: &[f64]| {
            let (x, y) = (p[0], p[1]);
            let jacobian = DMatrix::from_row_slice(2, 3, &[-20.0 * x, 10.0, 0.0, -1.0, 0.0, 0.0]);
            let values = vec![10.0 * (y - x * x), 1.0 - x];
            (y < 2.0).then(|| Evaluation { values, jacobian: Box::new(move || jacobian) })
        };
        let options = Options { iterations: 60, tolerance: 1e-14, ..Options::default() };
        let fit = minimise(&[-1.2, 1.0, 5.0], &[], &options, run).unwrap();
        assert!((fit.parameters[0] - 1.0).abs() < 1e-6, "{fit:?}");
        assert_eq!(fit.parameters[2], 5.0);
        assert!(fit.converged && fit.costs.windows(2).all(|pair| pair[1] < pair[0]), "{fit:?}");
        assert!(minimise(&[0.0, 3.0, 0.0], &[], &options, run).is_none());
    }

    /// Tests residuals that depend on the sum of the first two parameters only, and not on the final one.
    #[test]
    fn deviations_say_what_residuals_do_not_tell() {
        let jacobian = DMatrix::from_row_slice(
            3,
            4,
            &[
                2.0, 2.0, 0.0, 0.0, //
                0.0, 0.0, 4.0, 0.0, //
                1.0, 1.0, 3.0, 0.0,
            ],
        );
        let fit = Fit {
            parameters: vec![0.0; 4],
            costs: Vec::new(),
            rollouts: 0,
            converged: true,
            hessian: jacobian.tr_mul(&jacobian),
        };
        let found = fit.deviations();
        assert_eq!([found[0], found[1], found[3]], [f64::INFINITY; 3]);
        // Covariance of the sum and the third parameter: the inverse of [5 3; 3 25].
        assert!((found[2] - (5.0_f64 / 116.0).sqrt()).abs() < 1e-12, "{found:?}");
    }

    #[test]
    fn penalties_pull_knots_together_and_to_their_targets() {
        let mut penalties = Penalty::smooth(2, 3, true, 4.0);
        penalties.extend(Penalty::small(6, 0.01));
        let nothing = |_: &[f64]| {
            Some(Evaluation { values: Vec::new(), jacobian: Box::new(|| DMatrix::zeros(0, 6)) })
        };
        let start = [1.0, 0.0, 2.0, 0.0, 3.0, 0.0];
        let options = Options { shift: 1e-9, ..Options::default() };
        let fit = minimise(&start, &penalties, &options, nothing).unwrap();
        assert!((fit.costs[0] - 0.5 * (4.0 * 6.0 + 0.14)).abs() < 1e-12, "{fit:?}");
        assert!(fit.parameters.iter().all(|part| part.abs() < 1e-5), "{fit:?}");
    }
}
