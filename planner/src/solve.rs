//! Solvers, which lower the energy of a [`System`] of rows without knowledge of the underlying problem.
//!
//! [`Solver`] is Gauss-Newton with multipliers. It runs one iteration at a time, so that its caller can watch it, probe the
//! feasibility of the constraints, and restart it. Every row is squared. Gauss-Newton steps with Levenberg-Marquardt damping,
//! bent along curved constraints, lower the energy of [`crate::formulation`]. When the energy is nearly minimal for the present
//! multipliers, these are shifted: s ← s + r for equalities, s ← ψ′(r + s)/2 for inequalities. Constraints thus become exact
//! with a modest penalty. The thesis's penalty of 10 000 alone ([`penalty`]) creates a narrow curved valley instead.

mod curvature;
mod fronts;
mod look_ahead;
pub mod minimum;
mod multipliers;
pub mod normal;
mod one_sided;
pub mod optimum;
pub mod penalty;
mod progress;
mod settings;
mod trial;

pub use multipliers::Multipliers;
pub use progress::{Progress, level, worst};
pub use settings::{Method, Settings};
pub use trial::Point;

use crate::families::Family;
use crate::formulation::System;
use crate::formulation::rows::Rows;
use crate::plan::Status;
use crate::problem::Unknowns;
use look_ahead::look_ahead;
use normal::NormalEquations;
use trial::Trials;

/// Largest constraint residual in a converged plan, as a fraction of its tolerance.
pub const ACCEPTED_LEVEL: f64 = 0.2;

/// Number of nearly flat iterations without improvement of the worst constraint after which a solve is exhausted.
const MOST_NO_BETTER: usize = 25;
/// Number of iterations without any step after which a solve ends.
const MOST_WITHOUT_STEP: usize = 3;
/// Damping beyond which steps are too short to have an effect.
const DAMPING_LIMIT: f64 = 1e12;
/// Damping below which a step hardly changes: a rejected step is damped at least so much.
const DAMPING_FELT: f64 = 1e-4;
/// Likewise near an optimum, where hardly any step that fails undamped succeeds with less.
const DAMPING_FELT_NEAR: f64 = RAISE * DAMPING_FELT;
/// Scale factor of the damping after a rejected step.
const RAISE: f64 = 6.0;
/// Number of iterations before the solver uses look-ahead steps ([`look_ahead`]). Easy solves end earlier.
const EASY_ITERATIONS: usize = 12;
/// Fraction of the predicted decrease of the energy below which the solver tries a look-ahead step.
const LOOK_BELOW: f64 = 0.25;
/// Damping of the first step of a cold start, scaled variables.
const DAMPING_COLD: f64 = 1e-3;
/// Damping of the first step near an optimum, scaled variables: below the weakest costs.
const DAMPING_NEAR: f64 = 1e-7;

/// Additional knowledge at the start of a solve.
#[derive(Clone, Copy, Debug)]
pub enum SolveMode<'a> {
    /// Cold start: multipliers begin at zero, and steps are damped.
    Cold,
    /// Start near an optimum, with its multipliers if known. Multipliers that are missing or do not fit the rows are estimated.
    Near(Option<&'a Multipliers>),
}

/// Result of one iteration.
pub struct Iteration {
    /// Progress after the iteration.
    pub progress: Progress,
    /// Status of the solve; `None` if it has not ended.
    pub ended: Option<Status>,
    /// Absolute difference between the predicted and the actual decrease of the energy. After an undamped step it comes from the
    /// nonlinearity of the rows, and estimates how much the next step can gain. Infinite without a step and after a damped step,
    /// because the model of a short step is accurate far from any optimum too.
    pub mismatch: f64,
    /// True if the multipliers should be shifted: the energy is nearly minimal for them, and a constraint is violated.
    pub nearly_flat: bool,
    /// Number of nearly flat iterations since the worst constraint last improved.
    pub no_better: usize,
    /// True if `no_better` has reached its limit, so that the solve makes no progress.
    pub exhausted: bool,
}

/// Effect of a step on the energy.
struct StepEffect {
    /// Relative decrease of the energy; 0 without a step.
    decrease: f64,
    /// Mismatch as in [`Iteration::mismatch`].
    mismatch: f64,
}

/// Outcome of a solve.
#[derive(Clone, Debug)]
pub struct SolveOutcome {
    /// Status.
    pub status: Status,
    /// Number of iterations.
    pub iterations: usize,
    /// Final energy E(m).
    pub energy: f64,
    /// Worst constraint residual as a fraction of its tolerance.
    pub worst_level: f64,
    /// Family of the worst constraint.
    pub worst_constraint: Family,
    /// Final unknowns.
    pub unknowns: Unknowns,
    /// Final multipliers.
    pub multipliers: Multipliers,
}

/// Gauss-Newton with multipliers on one system.
pub struct Solver<'a> {
    system: &'a System<'a>,
    settings: &'a Settings,
    trials: Trials<'a>,
    normal: NormalEquations,
    point: Point,
    energy: f64,
    /// Multipliers: shift of every row.
    shifts: Vec<f64>,
    damping: f64,
    /// Smallest damping after a rejected step.
    damping_felt: f64,
    iteration: usize,
    step_length: f64,
    /// Level up to which the constraints count as met: that of the settings, or of rows that no step lowers.
    target_level: f64,
    /// Costs after the previous iteration.
    cost: f64,
    /// Level of the worst constraint in the best of the nearly flat iterations.
    best_level: f64,
    /// Number of nearly flat iterations since `best_level` last improved.
    no_better: usize,
    without_step: usize,
}

impl<'a> Solver<'a> {
    /// Creates a solver at its starting point.
    pub fn new(
        system: &'a System<'a>,
        unknowns: Unknowns,
        begin: SolveMode<'_>,
        settings: &'a Settings,
    ) -> Self {
        let rows = system.rows(&unknowns, Rows::default());
        let normal = NormalEquations::new(&rows, system.columns());
        Self::at(system, Point { unknowns, rows }, normal, begin, settings)
    }

    /// Creates a solver at a point whose row values are known. `normal` must come from rows with the same pattern.
    pub fn at(
        system: &'a System<'a>,
        mut point: Point,
        mut normal: NormalEquations,
        begin: SolveMode<'_>,
        settings: &'a Settings,
    ) -> Self {
        let penalty = system.penalty();
        let Point { unknowns, rows } = &mut point;
        let (damping, damping_felt, shifts) = match begin {
            SolveMode::Cold => (DAMPING_COLD, DAMPING_FELT, vec![0.0; rows.rows.len()]),
            SolveMode::Near(known) => {
                let carried = known.and_then(|multipliers| multipliers.carried(rows, penalty));
                let shifts = carried.unwrap_or_else(|| {
                    *rows = system.rows(unknowns, std::mem::take(rows));
                    multipliers::estimate(rows, &mut normal, penalty, DAMPING_NEAR)
                });
                (DAMPING_NEAR, DAMPING_FELT_NEAR, shifts)
            }
        };
        let energy = NormalEquations::energy(rows, &shifts, penalty);
        Self {
            system,
            settings,
            target_level: settings.target_level,
            trials: Trials { system, spare: Vec::new() },
            normal,
            point,
            energy,
            shifts,
            damping,
            damping_felt,
            iteration: 0,
            step_length: 0.0,
            cost: f64::INFINITY,
            best_level: f64::INFINITY,
            no_better: 0,
            without_step: 0,
        }
    }

    /// Number of iterations so far.
    pub fn iteration(&self) -> usize {
        self.iteration
    }

    /// Adds to the iteration count of the solve the iterations of a probe.
    pub fn count(&mut self, iterations: usize) {
        self.iteration += iterations;
    }

    /// Lends the normal equations and the present unknowns. The pattern of the normal equations belongs to the system.
    pub fn lend(&mut self) -> (&mut NormalEquations, &Unknowns) {
        (&mut self.normal, &self.point.unknowns)
    }

    /// Progress at the present point.
    pub fn present(&self) -> Progress {
        self.progress()
    }

    /// Returns true if the rows match the initial pattern of the system.
    pub fn fits(&self) -> bool {
        self.system.fits()
    }

    /// Linearises the rows and takes one step.
    pub fn iterate(&mut self) -> Iteration {
        self.iteration += 1;
        let StepEffect { decrease, mismatch } = self.step();
        let progress = self.progress();
        let level = progress.worst_level;
        let ended = self.end_without_step(level);
        let Settings { flat, flat_cost, nearly_flat, .. } = *self.settings;
        let target_level = self.target_level;
        // Where the quadratic model was right, another iteration would only confirm it.
        let change = (progress.cost - std::mem::replace(&mut self.cost, progress.cost)).abs();
        let is_flat = decrease < flat || change.min(mismatch) < flat_cost * progress.cost;
        if ended.is_some() || is_flat && level <= target_level {
            let ended = ended.or(Some(Status::Converged));
            return Iteration {
                progress,
                ended,
                mismatch,
                nearly_flat: false,
                no_better: 0,
                exhausted: false,
            };
        }
        let nearly_flat = decrease < nearly_flat && level > target_level;
        if nearly_flat {
            self.no_better = if level < 0.9 * self.best_level { 0 } else { self.no_better + 1 };
            self.best_level = if self.no_better == 0 { level } else { self.best_level };
        }
        let exhausted = self.no_better >= MOST_NO_BETTER;
        let ended = (exhausted && level <= ACCEPTED_LEVEL).then_some(Status::Converged);
        let no_better = self.no_better;
        Iteration { progress, ended, mismatch, nearly_flat, no_better, exhausted }
    }

    /// Increases the damping until a step achieves more than 0.1 % of the predicted decrease of the energy, and takes that step.
    fn step(&mut self) -> StepEffect {
        let Point { unknowns, rows } = &mut self.point;
        self.system.differentiate(unknowns, rows, &self.shifts);
        let fixed = progress::fixed_level(rows).min(ACCEPTED_LEVEL);
        self.target_level = self.settings.target_level.max(fixed);
        self.normal.assemble(rows, &self.shifts, self.system.penalty());
        let mut rejected = false;
        let mut may_look = self.iteration > EASY_ITERATIONS;
        // `plain` is the trial before look-ahead, `excess` the amount by which the model with planes exceeds the energy.
        let (mut plain, mut excess) = (None, None);
        while self.damping < DAMPING_LIMIT {
            let Self { system, trials, normal, point, energy, shifts, damping, .. } = self;
            let energy = *energy;
            let above = excess.unwrap_or(0.0);
            let taken = trials.take(normal, point, energy, shifts, *damping, above);
            let Some((mut trial, mut ratio)) = taken else {
                self.damping *= 10.0;
                continue;
            };
            if may_look && ratio < LOOK_BELOW {
                may_look = false;
                excess = look_ahead(system, normal, point, energy, shifts, &mut trial);
                if excess.is_some() {
                    plain = Some((trial, ratio));
                    continue;
                }
            }
            if let Some((before, ratio_before)) = plain.take() {
                let other = if before.energy < trial.energy {
                    ratio = ratio_before;
                    std::mem::replace(&mut trial, before)
                } else {
                    before
                };
                trials.spare.push(other.point.rows);
            }
            if ratio > 1e-3 {
                let gain = energy - trial.energy;
                let decrease = gain / energy.max(f64::MIN_POSITIVE);
                let is_full = self.damping <= DAMPING_NEAR;
                let mismatch = if is_full { (gain / ratio - gain).abs() } else { f64::INFINITY };
                self.step_length = trial.step.iter().map(|d| d * d).sum::<f64>().sqrt();
                self.energy = trial.energy;
                self.trials.spare.push(std::mem::replace(&mut self.point, trial.point).rows);
                // Damping that has just proved too low is not lowered again at once.
                if ratio > 0.7 && !rejected {
                    self.damping = (self.damping * 0.2).max(1e-9);
                } else if ratio < 0.25 {
                    self.damping *= 3.0;
                }
                return StepEffect { decrease, mismatch };
            }
            let lost = energy - trial.energy;
            self.trials.spare.push(trial.point.rows);
            if excess.take().is_some() {
                // Planes did not help.
                self.normal.assemble(&self.point.rows, &self.shifts, self.system.penalty());
            } else if lost > -1e-13 * energy {
                break; // As low as rounding lets it get.
            }
            rejected = true;
            self.damping = (self.damping * RAISE).max(self.damping_felt);
        }
        StepEffect { decrease: 0.0, mismatch: f64::INFINITY }
    }

    /// Resets damping that has reached its limit, because a less damped step may succeed with new multipliers. Ends the solve
    /// after several iterations without a step.
    fn end_without_step(&mut self, level: f64) -> Option<Status> {
        if self.damping < DAMPING_LIMIT {
            self.without_step = 0;
            return None;
        }
        self.damping = DAMPING_COLD;
        self.without_step += 1;
        let good = level <= ACCEPTED_LEVEL;
        (self.without_step >= MOST_WITHOUT_STEP).then_some(if good {
            Status::Converged
        } else {
            Status::Stalled
        })
    }

    /// Shifts the multipliers by the present residuals.
    pub fn shift_multipliers(&mut self) {
        for ((row, value), shift) in self.point.rows.iter().zip(&mut self.shifts) {
            *shift = multipliers::first_order_shift(row, value, *shift);
        }
        self.set_energy();
    }

    /// Continues from another point, without multipliers.
    pub fn restart(&mut self, point: Point) {
        self.shifts.fill(0.0);
        self.move_to(point);
        (self.damping, self.no_better, self.best_level) = (DAMPING_COLD, 0, f64::INFINITY);
        self.cost = f64::INFINITY;
    }

    /// Moves to another point.
    pub fn move_to(&mut self, point: Point) {
        self.point = point;
        self.set_energy();
    }

    fn set_energy(&mut self) {
        self.energy =
            NormalEquations::energy(&self.point.rows, &self.shifts, self.system.penalty());
    }

    /// Progress of the solve.
    fn progress(&self) -> Progress {
        let rows = &self.point.rows;
        Progress {
            iteration: self.iteration,
            damping: self.damping,
            step: self.step_length,
            ..Progress::at(rows, worst(rows), self.energy, self.system.penalty())
        }
    }

    /// Ends the solve with a status.
    pub fn finish(self, status: Status) -> SolveOutcome {
        self.finish_with_parts(status).0
    }

    /// Ends the solve with a status. Also returns the normal equations and rows, which [`at`](Self::at) accepts for another
    /// problem.
    pub fn finish_with_parts(self, status: Status) -> (SolveOutcome, NormalEquations, Rows) {
        let Point { unknowns, rows } = self.point;
        let (row, worst_level) = worst(&rows);
        let good = status == Status::IterationLimit && worst_level <= ACCEPTED_LEVEL;
        let outcome = SolveOutcome {
            status: if good { Status::Converged } else { status },
            iterations: self.iteration,
            energy: self.energy,
            worst_level,
            worst_constraint: rows.rows[row].family,
            unknowns,
            multipliers: Multipliers::of(&rows, self.shifts, self.system.penalty()),
        };
        (outcome, self.normal, rows)
    }
}
