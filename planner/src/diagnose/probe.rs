//! The point where constraints that contradict each other are violated least, and whether it is worth
//! going on.
//!
//! The solver's energy without its multipliers and all but without its costs is Σ r² over the violated
//! constraints. In a feasible problem that goes to zero in a few steps. Where it is stationary above zero
//! no small change meets all constraints, and what is left of each residual is its share in the
//! contradiction. So a solve that is still far off after a few iterations is probed: some steps on the
//! constraints alone tell impossible requests from slow ones long before multipliers would.

use crate::formulation::System;
use crate::formulation::rows::Rows;
use crate::plan::Verdict;
use crate::problem::Unknowns;
use crate::solve::normal::NormalEquations;
use crate::solve::{ACCEPTED_LEVEL, Point, Progress, worst};
use std::ops::ControlFlow;

/// Weight of the constraints against the costs, relative to a solve: enough that costs move residuals by
/// less than a part in a thousand.
const EMPHASIS: f64 = 1e3;
/// Most steps of one probe.
const STEPS: usize = 8;
/// Relative decrease of Σ r² over the last [`FLAT_STEPS`] steps below which it counts as stationary.
const FLAT: f64 = 0.05;
const FLAT_STEPS: usize = 3;
/// Ratio by which Σ r² falls within [`FALLING_STEPS`] steps on the way to something possible. Measured on
/// all shipped motions: 10 to 1000 where the solve succeeds, 1.2 to 3.5 for impossible ones.
const FALLING: f64 = 4.0;
const FALLING_STEPS: usize = 4;
/// Energies at the beginning that do not count: multipliers keep a solve away from the point with the least
/// violation, which the first steps go back to.
const SETTLING: usize = 2;
/// Worst constraint, as a multiple of its credible level, that counts as far off at the first probe. No
/// shipped motion is there. Later probes ask for [`PATIENCE`] times more each, as multipliers may have led a
/// slow solve away by then.
const FAR_LEVEL: f64 = 30.0;
/// Worst constraint, as a multiple of its credible level, above which a solve is probed again.
const DOUBTFUL_LEVEL: f64 = 1.0;
/// Iterations before the first probe, and the factor from one probe to the next.
const FIRST: usize = 6;
const PATIENCE: usize = 3;

/// Most dampings tried for a step.
const TRIALS: usize = 8;
/// Damping, relative to the constraints' weight, of a step that is as good as undamped: it may go as far as
/// a radian, a metre or a robot's weight in each unknown.
const UNDAMPED: f64 = 1e-6;
/// Part of the violation that the linearised constraints must promise to cure, or else they contradict each
/// other. Slow but feasible solves promise 0.4 or more, contradictions 0.002 to 0.07.
const CURABLE: f64 = 0.1;

/// When a solve is probed.
#[derive(Debug)]
pub struct Schedule {
    next: usize,
    far_level: f64,
}

impl Default for Schedule {
    fn default() -> Self {
        Self { next: FIRST, far_level: FAR_LEVEL }
    }
}

impl Schedule {
    /// Whether to probe now, with the worst constraint at `level`: the level that counts as far off then.
    /// Probes become rarer, so that slow solves do not pay much for them.
    pub fn due(&mut self, iteration: usize, level: f64) -> Option<f64> {
        if iteration < self.next {
            return None;
        }
        let far_level = self.far_level;
        let doubtful = if self.next == FIRST { far_level } else { DOUBTFUL_LEVEL };
        self.next = PATIENCE * iteration;
        self.far_level *= PATIENCE as f64;
        (level > doubtful).then_some(far_level)
    }

    /// The level that counts as far off when a solve has ended.
    pub fn far_level(&self) -> f64 {
        self.far_level
    }
}

/// Result of a probe.
#[derive(Debug)]
pub struct Nearest {
    /// Where the violation is least, as far as the probe came.
    pub point: Point,
    /// Evidence against the request; `None` as long as there is none.
    pub verdict: Option<Verdict>,
}

/// Search for the point where the constraints of one problem are violated least.
pub struct FeasibilityProbe<'a> {
    /// The rows of the problem.
    pub system: &'a System<'a>,
    /// Iterations that the solve has left.
    pub most_steps: usize,
    /// Worst constraint that counts as far off then.
    pub far_level: f64,
}

impl FeasibilityProbe<'_> {
    /// Lowers the violation from a point, with Levenberg-Marquardt steps. `progress` sees every step, at the
    /// weight of a solve, and may stop the probe, which then finds nothing.
    pub fn run(
        &self,
        normal: &mut NormalEquations,
        from: &Unknowns,
        progress: &mut dyn FnMut(&Progress) -> ControlFlow<()>,
    ) -> Option<Nearest> {
        let Self { system, most_steps, far_level } = *self;
        let penalty = EMPHASIS * system.penalty();
        let mut unknowns = from.clone();
        let mut rows = system.rows(&unknowns, Rows::default());
        let mut trial_rows = Rows::default();
        let shifts = vec![0.0; rows.rows.len()];
        let mut energy = NormalEquations::energy(&rows, &shifts, penalty);
        let mut damping = 1e-2 * penalty;
        let mut energies = vec![energy];
        let (mut flat, mut falling) = (false, false);
        for _ in 0..STEPS.min(most_steps) {
            normal.assemble(&rows, &shifts, penalty);
            let mut length = 0.0;
            for _ in 0..TRIALS {
                let Some(step) = normal.step(damping) else {
                    damping *= 10.0;
                    continue;
                };
                let trial = system.moved(&unknowns, &step);
                trial_rows = system.rows(&trial, trial_rows);
                let lower = NormalEquations::energy(&trial_rows, &shifts, penalty);
                let ratio = (energy - lower) / normal.promised_decrease(&step, damping);
                if ratio > 1e-3 {
                    damping *= if ratio > 0.7 {
                        0.2
                    } else if ratio < 0.25 {
                        3.0
                    } else {
                        1.0
                    };
                    length = step.iter().map(|d| d * d).sum::<f64>().sqrt();
                    unknowns = trial;
                    std::mem::swap(&mut rows, &mut trial_rows);
                    energy = lower;
                    break;
                }
                damping *= 6.0;
            }
            energies.push(energy);
            let state = Progress::at(&rows, worst(&rows), energy / EMPHASIS, system.penalty());
            if progress(&Progress { damping, step: length, ..state }).is_break() {
                return None;
            }
            let before = |steps: usize| energies.iter().skip(SETTLING).nth_back(steps).copied();
            flat = before(FLAT_STEPS).is_some_and(|before| energy > (1.0 - FLAT) * before);
            falling = before(FALLING_STEPS).is_some_and(|before| FALLING * energy < before);
            if flat || falling || worst(&rows).1 <= ACCEPTED_LEVEL {
                break;
            }
        }
        let (_, level) = worst(&rows);
        let verdict = if falling || level <= ACCEPTED_LEVEL {
            None
        } else {
            normal.assemble(&rows, &shifts, penalty);
            let damping = UNDAMPED * penalty;
            let promised =
                normal.step(damping).map(|step| normal.promised_decrease(&step, damping));
            match promised {
                Some(promised) if promised < CURABLE * energy => Some(Verdict::Contradiction),
                _ if level > far_level => Some(Verdict::FarOff),
                _ if flat => Some(Verdict::Stuck),
                _ => None,
            }
        };
        Some(Nearest { point: Point { unknowns, rows }, verdict })
    }
}
