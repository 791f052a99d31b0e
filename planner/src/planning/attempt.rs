//! One attempt: solves a motion from one start, after the solves that this start needs.

use super::probed_solve::{solve, solve_selected};
use super::{Request, Solution, coarse};
use crate::formulation::Selection;
use crate::plan::{StartKind, Started, Status};
use crate::problem::{Problem, Unknowns};
use crate::solve::{Begin, Progress, Settings};
use crate::start::{self, Start, WarmStart};
use rollwalk_multibody::euler::Model;
use std::ops::ControlFlow;

/// Solves a request.
pub(super) fn attempt(
    request: Request<'_>,
    progress: &mut dyn FnMut(&Progress) -> ControlFlow<()>,
) -> Solution {
    let Request { robot, motion, options } = request;
    let mut chosen = options.start;
    if chosen == Start::Coarse {
        if let Some(halved) = start::halved(motion) {
            return coarse::from_coarse(request, &halved, progress);
        }
        chosen = start::without_halving(robot, motion);
    }
    let problem = Problem::new(Model::new(robot), motion, options.weights.clone());
    let Beginning { unknowns, started, iterations, stopped } =
        beginning(&problem, chosen, options.seed, progress);
    let mut settings = options.settings.clone();
    if stopped {
        // After an interrupt the solve only evaluates the present point.
        settings.iterations = 0;
    }
    let mut counted = counting_from(iterations, progress);
    let mut solved = solve(&problem, unknowns, Begin::Cold, &settings, &mut counted);
    if stopped {
        solved.outcome.status = Status::Interrupted;
    }
    solved.outcome.iterations += iterations;
    solved.write(&problem, motion, started)
}

/// Progress callback with iterations counted from those before.
pub(super) fn counting_from<'a>(
    before: usize,
    progress: &'a mut dyn FnMut(&Progress) -> ControlFlow<()>,
) -> impl FnMut(&Progress) -> ControlFlow<()> + 'a {
    move |state| progress(&Progress { iteration: before + state.iteration, ..state.clone() })
}

/// Starting point with the effort spent on it.
struct Beginning {
    unknowns: Unknowns,
    started: Started,
    /// Count of iterations spent.
    iterations: usize,
    /// Whether it was interrupted.
    stopped: bool,
}

fn beginning(
    problem: &Problem,
    start: Start,
    seed: u64,
    progress: &mut dyn FnMut(&Progress) -> ControlFlow<()>,
) -> Beginning {
    if let Start::Warm(how) = start {
        return warm(problem, how, progress);
    }
    let (unknowns, started) = start::initial(problem, start, seed);
    Beginning { unknowns, started, iterations: 0, stopped: false }
}

/// Solves the problems of the warm start one after another.
fn warm(
    problem: &Problem,
    how: WarmStart,
    progress: &mut dyn FnMut(&Progress) -> ControlFlow<()>,
) -> Beginning {
    let (mut iterations, mut stopped) = (0, false);
    let mut stage = |stage: &Problem, selection: &Selection, unknowns: &mut Unknowns, most| {
        if stopped {
            return;
        }
        let settings = Settings { iterations: most, ..Settings::default() };
        let mut counted = counting_from(iterations, progress);
        let from = unknowns.clone();
        let (selection, begin) = (selection.clone(), Begin::Cold);
        let solved = solve_selected(stage, selection, from, begin, &settings, &mut counted);
        iterations += solved.outcome.iterations;
        stopped = solved.outcome.status == Status::Interrupted;
        *unknowns = solved.outcome.unknowns;
    };
    let unknowns = start::warm(problem, how, &mut stage);
    let started = Started { kind: StartKind::Warm, seed: 0 };
    Beginning { unknowns, started, iterations, stopped }
}
