//! Coarse-to-fine planning: a motion of many samples starts from its plan with half as many, recursively.

use super::attempt::{attempt, counting_from};
use super::replan;
use super::{Request, Solution};
use crate::motion::Motion;
use crate::plan::{StartKind, Started, Status};
use crate::solve::Progress;
use std::ops::ControlFlow;

/// Optimises a motion from the plan with half its samples, which may be found in the same way.
pub(super) fn from_coarse(
    request: Request<'_>,
    halved: &Motion,
    progress: &mut dyn FnMut(&Progress) -> ControlFlow<()>,
) -> Solution {
    let coarse = attempt(Request { motion: halved, ..request }, progress).plan;
    let before = coarse.solve.iterations;
    let stopped = coarse.solve.status == Status::Interrupted;
    let mut counted = counting_from(before, progress);
    let mut options = request.options.clone();
    if stopped {
        // After an interrupt the solve only evaluates the present point.
        options.settings.iterations = 0;
    }
    let mut solution =
        replan::from(&coarse, None, Request { options: &options, ..request }, &mut counted)
            .expect("one robot, one kind of ends");
    let solve = &mut solution.plan.solve;
    if stopped {
        solve.status = Status::Interrupted;
    }
    solve.start = Started { kind: StartKind::Coarse, seed: coarse.solve.start.seed };
    solve.iterations += before;
    solution
}
