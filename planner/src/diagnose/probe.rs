//! Search for the point where contradictory constraints are violated least, with a verdict on the solve.
//!
//! Without multipliers and almost without costs, the solver's energy is Σ r² over the violated constraints. In a feasible
//! problem it approaches zero in a few steps. If it is stationary above zero, no small change meets all constraints, and the
//! remaining residuals show the share of each constraint in the contradiction. A solve with large residuals after a few
//! iterations is therefore probed. Some steps on the constraints alone distinguish infeasible requests from slow solves long
//! before the multipliers would.

use crate::formulation::System;
use crate::formulation::rows::Rows;
use crate::plan::Verdict;
use crate::problem::Unknowns;
use crate::solve::normal::NormalEquations;
use crate::solve::{ACCEPTED_LEVEL, Iteration, Point, Progress, worst};
use std::ops::ControlFlow;

/// Weight of the constraints against the costs, relative to a solve. Costs then change residuals by less than 0.1 %.
const EMPHASIS: f64 = 1e3;
/// Maximum number of steps of a probe.
const STEPS: usize = 8;
/// Relative decrease of Σ r² over [`FLAT_STEPS`] steps below which Σ r² counts as stationary.
const FLAT: f64 = 0.05;
/// Number of steps over which [`FLAT`] is measured.
const FLAT_STEPS: usize = 3;
/// Factor by which Σ r² falls within [`FALLING_STEPS`] steps if the request is feasible. On all shipped motions, the factor is
/// 10 to 1000 for successful solves and 1.2 to 3.5 for infeasible requests.
const FALLING: f64 = 4.0;
/// Number of steps over which [`FALLING`] is measured.
const FALLING_STEPS: usize = 4;
/// Number of initial energies that are ignored. Multipliers keep a solve away from the point with the least violation, and the
/// first steps lead back to it.
const SETTLING: usize = 2;
/// Worst residual-to-tolerance ratio above which the first probe returns [`Verdict::FarOff`]. No shipped motion reaches it. Each
/// later probe requires [`PATIENCE`] times more, because multipliers may have led a slow solve away.
const FAR_LEVEL: f64 = 30.0;
/// Worst residual-to-tolerance ratio above which a solve is probed again.
const DOUBTFUL_LEVEL: f64 = 1.0;
/// Iterations before the first probe.
const FIRST: usize = 6;
/// Ratio of the iteration count at which a probe begins to that of the previous probe.
const PATIENCE: usize = 3;
/// Number of nearly flat iterations without improvement of the worst constraint after which a solve is probed, once. Near
/// misses have small residuals, while their multipliers grow without bound.
const HALTING: usize = 8;

/// Maximum number of dampings tried for a step.
const TRIALS: usize = 8;
/// Damping of a practically undamped step, relative to the constraints' weight. The step may change each unknown by a radian, a
/// metre or the weight of a robot.
const UNDAMPED: f64 = 1e-6;
/// Fraction of the violation that the linearised constraints must be able to remove. Below it, they contradict each other. Slow
/// but feasible solves reach 0.4 or more, contradictions 0.002 to 0.07.
const CURABLE: f64 = 0.1;

/// Schedule of the probes of a solve.
#[derive(Debug)]
pub struct Schedule {
    next: usize,
    far_level: f64,
    /// True once a solve has been probed because the worst constraint did not improve.
    halted: bool,
}

impl Default for Schedule {
    fn default() -> Self {
        Self { next: FIRST, far_level: FAR_LEVEL, halted: false }
    }
}

/// Probe that is due.
#[derive(Clone, Copy, Debug)]
pub struct DueProbe {
    /// Worst residual-to-tolerance ratio above which the probe returns [`Verdict::FarOff`].
    pub far_level: f64,
    /// True if a solve that is merely stuck should continue. Some such solves converge after more iterations.
    pub is_early: bool,
}

impl Schedule {
    /// Returns the probe that is due after an iteration. Probes become rarer, so that slow solves spend little time on them.
    pub fn due(&mut self, iteration: usize, last: &Iteration) -> Option<DueProbe> {
        if last.no_better == HALTING && !std::mem::replace(&mut self.halted, true) {
            return Some(DueProbe { far_level: self.far_level, is_early: true });
        }
        let level = last.progress.worst_level;
        if iteration < self.next {
            return None;
        }
        let far_level = self.far_level;
        let doubtful = if self.next == FIRST { far_level } else { DOUBTFUL_LEVEL };
        self.next = PATIENCE * iteration;
        self.far_level *= PATIENCE as f64;
        (level > doubtful).then_some(DueProbe { far_level, is_early: false })
    }

    /// Returns the worst residual-to-tolerance ratio above which a probe at the end of a solve returns [`Verdict::FarOff`].
    pub fn far_level(&self) -> f64 {
        self.far_level
    }
}

/// Result of a probe.
#[derive(Debug)]
pub struct ProbeResult {
    /// Point with the least violation that the probe has found.
    pub point: Point,
    /// Verdict against the request; `None` if there is no evidence.
    pub verdict: Option<Verdict>,
}

/// Search for the point where the constraints of one problem are violated least.
pub struct FeasibilityProbe<'a> {
    /// Rows of the problem.
    pub system: &'a System<'a>,
    /// Iterations left for the solve.
    pub most_steps: usize,
    /// Worst residual-to-tolerance ratio above which the probe returns [`Verdict::FarOff`].
    pub far_level: f64,
}

impl FeasibilityProbe<'_> {
    /// Lowers the violation from a point with Levenberg-Marquardt steps.
    ///
    /// `progress` is called after every step, with the energy at the constraint weight of a solve, and may stop the probe. A
    /// stopped probe returns `None`.
    pub fn run(
        &self,
        normal: &mut NormalEquations,
        from: &Unknowns,
        progress: &mut dyn FnMut(&Progress) -> ControlFlow<()>,
    ) -> Option<ProbeResult> {
        let Self { system, most_steps, far_level } = *self;
        let penalty = EMPHASIS * system.penalty();
        let mut unknowns = from.clone();
        let mut rows = system.values(&unknowns, Rows::default());
        let mut trial_rows = Rows::default();
        let shifts = vec![0.0; rows.rows.len()];
        let mut energy = NormalEquations::energy(&rows, &shifts, penalty);
        let mut damping = 1e-2 * penalty;
        let mut energies = vec![energy];
        let (mut flat, mut falling) = (false, false);
        for _ in 0..STEPS.min(most_steps) {
            system.differentiate(&unknowns, &mut rows, &shifts);
            normal.assemble(&rows, &shifts, penalty);
            let mut length = 0.0;
            for _ in 0..TRIALS {
                let Some(step) = normal.step(damping) else {
                    damping *= 10.0;
                    continue;
                };
                let trial = system.moved(&unknowns, &step);
                trial_rows = system.values(&trial, trial_rows);
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
            system.differentiate(&unknowns, &mut rows, &shifts);
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
        Some(ProbeResult { point: Point { unknowns, rows }, verdict })
    }
}
