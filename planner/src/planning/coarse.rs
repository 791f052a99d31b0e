//! Coarse-to-fine planning: a motion of many samples starts from its plan with half as many, recursively.

use super::attempt::{attempt, counting_from};
use super::replan;
use super::{Options, Solution};
use crate::motion::Motion;
use crate::plan::{StartKind, Started, Status};
use crate::solve::Progress;
use rollwalk_robot::Robot;
use std::ops::ControlFlow;

/// Optimises a motion from the plan with half its samples, which may be found in the same way.
pub(super) fn from_coarse(
    robot: &Robot,
    motion: &Motion,
    halved: &Motion,
    options: &Options,
    progress: &mut dyn FnMut(&Progress) -> ControlFlow<()>,
) -> Solution {
    let coarse = attempt(robot, halved, options, progress).plan;
    let before = coarse.solve.iterations;
    let stopped = coarse.solve.status == Status::Interrupted;
    let mut counted = counting_from(before, progress);
    let mut options = options.clone();
    if stopped {
        // After an interrupt the solve only evaluates the present point.
        options.settings.iterations = 0;
    }
    let mut solution = replan::from(&coarse, None, robot, motion, &options, &mut counted)
        .expect("one robot, one kind of ends");
    let solve = &mut solution.plan.solve;
    if stopped {
        solve.status = Status::Interrupted;
    }
    solve.start = Started { kind: StartKind::Coarse, seed: coarse.solve.start.seed };
    solve.iterations += before;
    solution
}
