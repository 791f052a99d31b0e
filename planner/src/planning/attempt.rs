//! Solve of a motion from one start, after the preparatory solves of that start.

use super::effort::Effort;
use super::neighbour;
use super::probed_solve::{DiagnosedOutcome, solve, solve_selected};
use super::request::{Options, Request};
use super::solution::Solution;
use crate::motion::Motion;
use crate::plan::{SolveStart, StartKind, Status};
use crate::problem::{Problem, Unknowns};
use crate::solve::{Settings, SolveMode};
use crate::start::{self, Start, WarmStart};

pub(super) fn attempt(request: Request<'_>, effort: &mut Effort<'_>) -> Solution {
    attempt_with(DiagnosedOutcome::write, request, effort)
}

/// Solves as [`attempt`] does. `write` converts the outcome of a solve without coarse start.
fn attempt_with(
    write: fn(DiagnosedOutcome, &Problem, &Motion, SolveStart) -> Solution,
    request: Request<'_>,
    effort: &mut Effort<'_>,
) -> Solution {
    let Request { robot, motion, options } = request;
    let mut chosen = options.start;
    if chosen == Start::Coarse {
        if let Some(halved) = start::halved(robot, motion) {
            return from_coarse(request, &halved, effort);
        }
        chosen = start::without_halving(robot, motion);
    }
    let problem = Problem::new(motion.model(robot), motion, options.weights.clone());
    let (unknowns, started) = match chosen {
        Start::Warm(how) => {
            (warm(&problem, how, effort), SolveStart { kind: StartKind::Warm, seed: 0 })
        }
        chosen => start::initial(&problem, motion, chosen, options.seed),
    };
    let solved = solve(&problem, unknowns, SolveMode::Cold, &options.settings, effort);
    write(solved, &problem, motion, started)
}

/// Solves a request from the plan with half its samples. That plan in turn may come from a plan with a quarter of them.
///
/// On free wheels and skates this is the first candidate. If it finds no plan, the start without halving is tried in its place
/// and decides the outcome.
fn from_coarse(request: Request<'_>, halved: &Motion, effort: &mut Effort<'_>) -> Solution {
    let Request { robot, motion, options } = request;
    let decides = start::any_rolls_freely(robot, motion);
    let attempt_without_halving = |effort: &mut Effort<'_>| {
        let options = &Options { start: start::without_halving(robot, motion), ..options.clone() };
        attempt(Request { options, ..request }, effort)
    };
    // A start does not need torques.
    let request_coarse = Request { motion: halved, ..request };
    let coarse = attempt_with(DiagnosedOutcome::write_without_torques, request_coarse, effort).plan;
    if decides && coarse.solve.status == Status::Infeasible {
        return attempt_without_halving(effort);
    }
    let mut solution =
        neighbour::from(&coarse, None, request, effort).expect("one robot, one kind of ends");
    if decides && matches!(solution.plan.solve.status, Status::Infeasible | Status::Stalled) {
        return attempt_without_halving(effort);
    }
    solution.plan.solve.start =
        SolveStart { kind: StartKind::Coarse, seed: coarse.solve.start.seed };
    solution
}

/// Solves the preparatory problems of a warm start in turn, and returns the resulting unknowns.
fn warm(problem: &Problem, how: WarmStart, effort: &mut Effort<'_>) -> Unknowns {
    start::warm(problem, how, &mut |stage, selection, unknowns, iterations| {
        if effort.interrupted {
            return;
        }
        let settings = Settings { iterations, ..Settings::default() };
        let (selection, from) = (selection.clone(), unknowns.clone());
        let solved = solve_selected(stage, selection, from, SolveMode::Cold, &settings, effort);
        *unknowns = solved.outcome.unknowns;
    })
}
