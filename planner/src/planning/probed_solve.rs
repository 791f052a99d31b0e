//! Solve with feasibility probes. A probe determines whether the constraints can be met and, if not, which of them conflict.
//!
//! The solver sees rows only. This module decides when to probe, whether to continue from the point that a probe has found, and
//! when to end the solve with a diagnosis.

use super::effort::Effort;
use super::solution::Solution;
use super::structures::Prepared;
use super::write::write_samples;
use crate::diagnose::{FeasibilityProbe, Schedule, diagnose};
use crate::formulation::{Selection, System};
use crate::motion::Motion;
use crate::plan::{Diagnosis, SolveStart, SolveSummary, Status, Verdict};
use crate::problem::{Problem, Unknowns};
use crate::solve::{Method, Progress, Settings, SolveMode, SolveOutcome, Solver, penalty};
use crate::torque;

/// Outcome of a solve, with a diagnosis if the solve failed.
pub(super) struct DiagnosedOutcome {
    /// Outcome. The iterations are those of all solves of the request.
    pub outcome: SolveOutcome,
    pub diagnosis: Option<Diagnosis>,
}

impl DiagnosedOutcome {
    /// Converts the outcome to the solution of a motion.
    pub fn write(self, problem: &Problem, motion: &Motion, start: SolveStart) -> Solution {
        let mut solution = self.write_without_torques(problem, motion, start);
        torque::write(&mut solution.plan);
        solution
    }

    /// Converts the outcome to the solution of a motion, whose plan has no feed-forward torques.
    pub fn write_without_torques(
        self,
        problem: &Problem,
        motion: &Motion,
        start: SolveStart,
    ) -> Solution {
        let Self { outcome, diagnosis } = self;
        let SolveOutcome { status, iterations, energy, worst_level, worst_constraint, .. } =
            outcome;
        let summary = SolveSummary {
            status,
            iterations,
            energy,
            worst_level,
            worst_constraint,
            start,
            diagnosis,
            refinements: Vec::new(),
            timing: None,
        };
        let plan = write_samples(problem, motion, &outcome.unknowns, summary);
        Solution { plan, multipliers: outcome.multipliers }
    }
}

/// Minimises E(m) from a starting point.
///
/// The callback of `effort` may stop the solve, which then returns its latest point. The solve is deterministic.
pub(super) fn solve(
    problem: &Problem,
    unknowns: Unknowns,
    begin: SolveMode<'_>,
    settings: &Settings,
    effort: &mut Effort<'_>,
) -> DiagnosedOutcome {
    solve_selected(problem, Selection::default(), unknowns, begin, settings, effort)
}

/// Runs [`solve`] on a selection of rows.
pub(super) fn solve_selected(
    problem: &Problem,
    selection: Selection,
    unknowns: Unknowns,
    begin: SolveMode<'_>,
    settings: &Settings,
    effort: &mut Effort<'_>,
) -> DiagnosedOutcome {
    // After an interrupt the solve only evaluates the present point.
    let iterations = if effort.interrupted { 0 } else { settings.iterations };
    let settings = &Settings { iterations, ..settings.clone() };
    let mut solved = probed(problem, selection, unknowns, begin, settings, effort);
    if effort.interrupted {
        solved.outcome.status = Status::Interrupted;
    }
    effort.add(&mut solved.outcome.iterations);
    solved
}

/// Runs [`solve_selected`] without counting the iterations of earlier solves.
fn probed(
    problem: &Problem,
    selection: Selection,
    mut unknowns: Unknowns,
    begin: SolveMode<'_>,
    settings: &Settings,
    effort: &mut Effort<'_>,
) -> DiagnosedOutcome {
    problem.add_up(&mut unknowns);
    if settings.method != Method::GaussNewton {
        let system = System::selected(problem, selection);
        // At the balance of penalties and costs the residuals do not show which constraints contradict each other.
        let outcome =
            penalty::solve(&system, unknowns, settings, &mut |state| effort.report(state));
        return DiagnosedOutcome { outcome, diagnosis: None };
    }
    if selection != Selection::default() {
        let system = System::selected(problem, selection);
        let solver = Solver::new(&system, unknowns, begin, settings);
        let (solver, status, diagnosis) = iterate(problem, &system, solver, settings, effort);
        return DiagnosedOutcome { outcome: solver.finish(status), diagnosis };
    }
    let structures = effort.structures.clone();
    let mut prepared = structures.prepare(problem, unknowns.clone(), false);
    loop {
        let Prepared { system, point, normal, is_kept } = prepared;
        let solver = Solver::at(&system, point, normal, begin, settings);
        let (solver, status, diagnosis) = iterate(problem, &system, solver, settings, effort);
        if is_kept && !solver.fits() {
            drop(solver);
            prepared = structures.prepare(problem, unknowns.clone(), true);
            continue;
        }
        let (outcome, normal, rows) = solver.finish_with_parts(status);
        structures.keep(system, normal, rows);
        return DiagnosedOutcome { outcome, diagnosis };
    }
}

/// Iterates until the solve ends. Returns early if the rows do not have the pattern of the system.
fn iterate<'a>(
    problem: &Problem,
    system: &System<'_>,
    mut solver: Solver<'a>,
    settings: &Settings,
    effort: &mut Effort<'_>,
) -> (Solver<'a>, Status, Option<Diagnosis>) {
    let mut probes = Schedule::default();
    let mut restarted = false;
    let mut diagnosis = None;
    let status = loop {
        if solver.iteration() >= settings.iterations {
            break Status::IterationLimit;
        }
        let iteration = solver.iterate();
        if !solver.fits() {
            break Status::Stalled;
        }
        if effort.report(&iteration.progress).is_break() {
            break Status::Interrupted;
        }
        if let Some(status) = iteration.ended {
            break status;
        }
        let due = probes.due(solver.iteration(), &iteration);
        if due.is_some() || iteration.exhausted {
            let probe = FeasibilityProbe {
                system,
                most_steps: settings.iterations - solver.iteration(),
                far_level: due.map_or_else(|| probes.far_level(), |due| due.far_level),
            };
            let before = solver.iteration();
            let mut steps = 0;
            let (normal, from) = solver.lend();
            let nearest = probe.run(normal, from, &mut |state| {
                steps += 1;
                effort.report(&Progress { iteration: before + steps, ..state.clone() })
            });
            solver.count(steps);
            let Some(nearest) = nearest else { break Status::Interrupted };
            if due.is_some_and(|due| due.is_early) && nearest.verdict == Some(Verdict::Stuck) {
                solver.shift_multipliers();
                continue;
            }
            let stuck = iteration.exhausted.then_some(Verdict::Stuck);
            if let Some(verdict) = nearest.verdict.or(stuck) {
                if nearest.verdict.is_none() && !restarted {
                    // Constraints can be met close by, or nearly: the solve continues from there, once.
                    restarted = true;
                    solver.restart(nearest.point);
                    continue;
                }
                diagnosis = diagnose(problem, &nearest.point.rows, verdict);
                // The plan shows the contradiction with the least violation.
                solver.move_to(nearest.point);
                break if diagnosis.is_some() { Status::Infeasible } else { Status::Stalled };
            }
        }
        if iteration.nearly_flat {
            solver.shift_multipliers();
        }
    };
    (solver, status, diagnosis)
}

#[cfg(test)]
mod tests;
