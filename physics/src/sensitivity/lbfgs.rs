//! Limited-memory BFGS method on rollouts (thesis 4.7.4), with gradients from the adjoint method.
//!
//! The method suits objectives that are not sums of a few squares, and problems with too many parameters and residuals for a
//! Jacobian. A bracketing line search finds points with sufficient decrease and a flatter slope (weak Wolfe conditions). It
//! requires no smoothness, which contacts do not provide (Lewis & Overton 2013). A failed rollout counts as infinitely bad and
//! becomes the upper end of the bracket.

use crate::sensitivity::objective::cost;
use crate::sensitivity::{Residual, Rollout};
use nalgebra::DVector;
use std::collections::VecDeque;

/// Objective of a rollout at given parameters.
pub struct Evaluation {
    /// Value of the objective.
    pub cost: f64,
    /// Computes the gradient. Called only for points with sufficient decrease.
    #[allow(clippy::type_complexity, reason = "the type has no other use")]
    pub gradient: Box<dyn FnOnce() -> Vec<f64>>,
}

impl std::fmt::Debug for Evaluation {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Evaluation").field("cost", &self.cost).finish_non_exhaustive()
    }
}

impl From<(Rollout, Vec<Residual>)> for Evaluation {
    fn from((rollout, residuals): (Rollout, Vec<Residual>)) -> Self {
        Self { cost: cost(&residuals), gradient: Box::new(move || rollout.gradient(&residuals)) }
    }
}

/// Stopping criteria and step limits.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Options {
    /// Maximum number of rollouts.
    pub rollouts: usize,
    /// Ratio of the objective to its initial value at which the method ends.
    pub cost: f64,
    /// Ratio of the gradient's norm to its initial value at which the method ends.
    pub gradient: f64,
    /// Maximum change of a parameter in the first iteration, before the curvature of the objective is known.
    pub first: f64,
    /// Maximum change of a parameter in an iteration.
    pub most: f64,
}

impl Default for Options {
    fn default() -> Self {
        Self { rollouts: 100, cost: 1e-24, gradient: 1e-12, first: 0.1, most: f64::INFINITY }
    }
}

/// Maximum number of stored steps, with their changes of the gradient.
const MEMORY: usize = 10;
/// Smallest ratio of the actual to the linearly predicted decrease of an accepted step.
const DECREASE: f64 = 1e-4;
/// Largest ratio of the final to the initial slope of an accepted step.
const SLOPE: f64 = 0.9;
/// Maximum number of rollouts in a line search.
const TRIALS: u32 = 30;
/// Smallest distance of a trial from the ends of its bracket, as a fraction of the bracket.
const NEAREST: f64 = 0.1;
/// Fraction of the bracket for the next trial after a failed rollout.
const AFTER_FAILURE: f64 = 0.25;

/// Result of the method.
#[derive(Clone, Debug, PartialEq)]
pub struct Minimum {
    /// Best parameters.
    pub parameters: Vec<f64>,
    /// Best objective so far, initially and after each rollout.
    pub best: Vec<f64>,
    /// Number of failed rollouts.
    pub failures: usize,
    /// Number of iterations.
    pub iterations: usize,
    /// True if the objective or gradient reached its limit, or no step improves the objective.
    pub converged: bool,
}

impl Minimum {
    /// Number of rollouts, failed ones included.
    pub fn rollouts(&self) -> usize {
        self.best.len()
    }

    /// Ratio of the best objective to the initial one.
    pub fn share(&self) -> f64 {
        self.best[self.best.len() - 1] / self.best[0]
    }
}

/// Parameters with their objective and gradient.
struct Point {
    at: DVector<f64>,
    cost: f64,
    gradient: DVector<f64>,
}

/// Minimises an objective. `run` evaluates a rollout at given parameters; `None` if the rollout fails.
///
/// Returns `None` if the rollout fails at the initial parameters.
pub fn minimise(
    start: &[f64],
    options: &Options,
    run: impl FnMut(&[f64]) -> Option<Evaluation>,
) -> Option<Minimum> {
    let mut search = Search { run, best: Vec::new(), failures: 0, options };
    let first = (search.run)(start)?;
    search.best.push(first.cost);
    let mut now = Point {
        at: DVector::from_column_slice(start),
        cost: first.cost,
        gradient: DVector::from_vec((first.gradient)()),
    };
    let (least_cost, least_gradient) =
        (options.cost * now.cost, options.gradient * now.gradient.norm());
    let mut memory = Memory::default();
    let mut iterations = 0;
    let converged = loop {
        if now.cost <= least_cost || now.gradient.norm() <= least_gradient {
            break true;
        }
        if search.best.len() >= options.rollouts {
            break false;
        }
        let mut direction = -memory.times(&now.gradient);
        if memory.pairs.is_empty() {
            direction *= options.first / now.gradient.amax();
        }
        match search.step(&now, &direction) {
            Some(next) => {
                memory.add(&next.at - &now.at, &next.gradient - &now.gradient);
                now = next;
                iterations += 1;
            }
            // The memory may be the cause, so it is cleared.
            None if !memory.pairs.is_empty() => memory = Memory::default(),
            None => break search.best.len() < options.rollouts,
        }
    };
    let Search { best, failures, .. } = search;
    Some(Minimum { parameters: now.at.as_slice().to_vec(), best, failures, iterations, converged })
}

/// Previous steps and their changes of the gradient, which approximate the inverse Hessian.
#[derive(Default)]
struct Memory {
    pairs: VecDeque<(DVector<f64>, DVector<f64>)>,
}

impl Memory {
    fn add(&mut self, step: DVector<f64>, change: DVector<f64>) {
        // The weak Wolfe conditions make this product positive except for rounding.
        if step.dot(&change) > f64::EPSILON * step.norm() * change.norm() {
            self.pairs.push_back((step, change));
            if self.pairs.len() > MEMORY {
                self.pairs.pop_front();
            }
        }
    }

    /// Product of the approximate inverse Hessian and a gradient.
    fn times(&self, gradient: &DVector<f64>) -> DVector<f64> {
        let mut product = gradient.clone();
        let mut shares = Vec::with_capacity(self.pairs.len());
        for (step, change) in self.pairs.iter().rev() {
            let share = step.dot(&product) / step.dot(change);
            product -= change * share;
            shares.push(share);
        }
        if let Some((step, change)) = self.pairs.back() {
            product *= step.dot(change) / change.norm_squared();
        }
        for ((step, change), share) in self.pairs.iter().zip(shares.iter().rev()) {
            product += step * (share - change.dot(&product) / step.dot(change));
        }
        product
    }
}

struct Search<'a, Run> {
    run: Run,
    best: Vec<f64>,
    failures: usize,
    options: &'a Options,
}

impl<Run: FnMut(&[f64]) -> Option<Evaluation>> Search<'_, Run> {
    fn evaluate(&mut self, at: &DVector<f64>) -> Option<Evaluation> {
        let evaluation = (self.run)(at.as_slice()).filter(|found| found.cost.is_finite());
        self.failures += usize::from(evaluation.is_none());
        let so_far = self.best[self.best.len() - 1];
        self.best.push(evaluation.as_ref().map_or(so_far, |found| found.cost.min(so_far)));
        evaluation
    }

    /// Line search along a direction. Returns `None` if it finds no better point.
    fn step(&mut self, from: &Point, direction: &DVector<f64>) -> Option<Point> {
        let slope = from.gradient.dot(direction);
        if slope.is_nan() || slope >= 0.0 {
            return None;
        }
        let longest = self.options.most / direction.amax();
        let (mut low, mut high) = (0.0, f64::INFINITY);
        let (mut low_cost, mut low_slope) = (from.cost, slope);
        let mut length = longest.min(1.0);
        let mut found = None;
        for _ in 0..TRIALS {
            if self.best.len() >= self.options.rollouts {
                break;
            }
            let at = &from.at + direction * length;
            let trial = self.evaluate(&at);
            let decreased =
                |trial: &Evaluation| trial.cost <= from.cost + DECREASE * length * slope;
            match trial {
                Some(trial) if decreased(&trial) => {
                    let gradient = DVector::from_vec((trial.gradient)());
                    let end_slope = gradient.dot(direction);
                    let point = Point { at, cost: trial.cost, gradient };
                    if end_slope >= SLOPE * slope || length == longest {
                        return Some(point);
                    }
                    (low, low_cost, low_slope) = (length, trial.cost, end_slope);
                    found = Some(point);
                    length = if high.is_finite() { 0.5 * (low + high) } else { 2.0 * length };
                }
                Some(trial) => {
                    high = length;
                    // Minimum of the parabola through both ends.
                    let width = high - low;
                    let bend = trial.cost - low_cost - low_slope * width;
                    let share = -0.5 * low_slope * width / bend;
                    length = low + width * share.clamp(NEAREST, 1.0 - NEAREST);
                }
                None => {
                    high = length;
                    length = low + AFTER_FAILURE * (high - low);
                }
            }
            length = length.min(longest);
        }
        found
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Rosenbrock's valley. Rollouts fail unless y is below `wall`.
    fn valley(wall: f64) -> impl FnMut(&[f64]) -> Option<Evaluation> {
        move |p: &[f64]| {
            let (across, along) = (10.0 * (p[1] - p[0] * p[0]), 1.0 - p[0]);
            let gradient = vec![-20.0 * p[0] * across - along, 10.0 * across];
            let cost = 0.5 * (across * across + along * along);
            (p[1] < wall).then(|| Evaluation { cost, gradient: Box::new(|| gradient) })
        }
    }

    #[test]
    fn it_finds_the_end_of_a_bent_valley_past_a_wall_of_failures() {
        let mut failures = 0;
        let options = Options { first: 2.0, ..Options::default() };
        for wall in [f64::INFINITY, 3.0, 2.0, 1.5] {
            let found = minimise(&[-1.2, 1.0], &options, valley(wall)).unwrap();
            assert!(found.converged && found.share() < 1e-20, "{found:?}");
            assert!(found.rollouts() < 80, "{found:?}");
            assert!(found.parameters.iter().all(|part| (part - 1.0).abs() < 1e-8), "{found:?}");
            failures += found.failures;
        }
        assert!(failures > 0);
        assert!(minimise(&[0.0, 2.0], &Options::default(), valley(1.0)).is_none());
    }

    /// Tests that a convex quadratic of n variables takes little more than n steps, and that the budget of rollouts is kept.
    #[test]
    fn a_quadratic_is_minimised_within_the_budget() {
        let run = |p: &[f64]| {
            let factor = |k: usize| 1.0 + k as f64 * k as f64;
            let cost = (0..8).map(|k| 0.5 * factor(k) * p[k] * p[k]).sum();
            let gradient: Vec<f64> = (0..8).map(|k| factor(k) * p[k]).collect();
            Some(Evaluation { cost, gradient: Box::new(|| gradient) })
        };
        let found = minimise(&[1.0; 8], &Options::default(), run).unwrap();
        assert!(found.converged && found.rollouts() < 50, "{found:?}");
        let options = Options { rollouts: 7, ..Options::default() };
        let found = minimise(&[1.0; 8], &options, run).unwrap();
        assert!(!found.converged && found.rollouts() == 7, "{found:?}");
        assert!(found.best.windows(2).all(|pair| pair[1] <= pair[0]), "{found:?}");
    }

    /// Tests a kink along the bottom of the valley, as from contacts, and the limit on the step length.
    #[test]
    fn kinks_do_not_stop_it_early() {
        let mut last: Option<Vec<f64>> = None;
        let run = |p: &[f64]| {
            if let Some(last) = &last {
                assert!((p[0] - last[0]).abs().max((p[1] - last[1]).abs()) < 10.0);
            }
            last = Some(p.to_vec());
            let cost = p[0].abs() + 0.1 * p[1] * p[1];
            let gradient = vec![p[0].signum(), 0.2 * p[1]];
            Some(Evaluation { cost, gradient: Box::new(|| gradient) })
        };
        let options = Options { most: 0.5, ..Options::default() };
        let found = minimise(&[1.0, 3.0], &options, run).unwrap();
        assert!(found.share() < 1e-3, "{found:?}");
    }
}
