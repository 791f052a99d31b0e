//! Planning after an edit, from the previous plan and, if known, its multipliers.
//!
//! Planners are used most for editing a goal, a duration or a limb and seeing the consequences. A neighbouring plan
//! is nearly optimal, so that a few iterations complete the solve. Where they do not, the request is planned from scratch
//! before it is called infeasible.

use super::effort::Effort;
use super::neighbour::{self, ReplanError};
use super::refine;
use super::request::{Options, Request};
use super::search::{Search, candidates};
use super::second_look::second_look;
use super::solution::Solution;
use super::trials::OwnEnds;
use crate::motion::Motion;
use crate::plan::{Plan, Status};
use crate::report::Report;
use crate::solve::{Multipliers, Progress};
use crate::start::Start;
use rollwalk_robot::Robot;
use std::ops::ControlFlow;

/// Optimises a motion from the plan of a neighbouring one.
///
/// `robot` has the structure of the plan's robot, its measures may differ. `motion` has the same kind of
/// ends, periodic or at rest; duration, sample count, goal and footfalls may differ. Start and seed in
/// `options` play no part. As with [`optimise`](crate::optimise) the outcome is in the plan's solve
/// summary. A plan far away may converge worse than none; where it does not at all, none is used.
///
/// # Errors
/// The plan cannot be played by the robot, or has other ends.
pub fn replan(
    previous: &Plan,
    robot: &Robot,
    motion: &Motion,
    options: &Options,
    progress: &mut dyn FnMut(&Progress) -> ControlFlow<()>,
) -> Result<Plan, ReplanError> {
    Ok(replan_solution(previous, robot, motion, options, progress)?.plan)
}

/// Plans the motion of a plan with twice its samples, from that plan; `None` if that would be too many of them, or if no
/// consistent plan is found.
pub fn replan_finer(
    plan: &Plan,
    options: &Options,
    progress: &mut dyn FnMut(&Progress) -> ControlFlow<()>,
) -> Option<Plan> {
    let finer = refine::doubled(&plan.motion)?;
    let mut found = replan(plan, &plan.robot, &finer, options, progress).ok()?;
    found.solve.start = plan.solve.start;
    found.solve.refinements.splice(0..0, plan.solve.refinements.iter().cloned());
    let is_solved = found.solve.status.is_solved();
    (is_solved && Report::as_played(&found).judgement.is_good()).then_some(found)
}

/// Does the same as [`replan`] and returns the multipliers too.
///
/// # Errors
/// As [`replan`].
pub fn replan_solution(
    previous: &Plan,
    robot: &Robot,
    motion: &Motion,
    options: &Options,
    progress: &mut dyn FnMut(&Progress) -> ControlFlow<()>,
) -> Result<Solution, ReplanError> {
    let effort = &mut Effort::new(progress);
    let solution = surely(previous, None, Request { robot, motion, options }, effort)?;
    Ok(refine::motion(solution, robot, options, effort))
}

impl Solution {
    /// [`replan`] that starts with the multipliers of this solution as well, if the motion's
    /// constraints have the same pattern.
    ///
    /// # Errors
    /// The plan cannot be played by the robot, or has other ends.
    pub fn replan(
        &self,
        robot: &Robot,
        motion: &Motion,
        options: &Options,
        progress: &mut dyn FnMut(&Progress) -> ControlFlow<()>,
    ) -> Result<Self, ReplanError> {
        let (request, effort) = (Request { robot, motion, options }, &mut Effort::new(progress));
        let solution = surely(&self.plan, Some(&self.multipliers), request, effort)?;
        Ok(refine::motion(solution, robot, options, effort))
    }

    /// Plans as [`replan`](Self::replan) does, from this solution alone: nothing else is tried where it does not lead to a plan.
    ///
    /// # Errors
    /// Errors of [`replan`](Self::replan).
    pub fn replan_near(
        &self,
        robot: &Robot,
        motion: &Motion,
        options: &Options,
        progress: &mut dyn FnMut(&Progress) -> ControlFlow<()>,
    ) -> Result<Self, ReplanError> {
        let (request, effort) = (Request { robot, motion, options }, &mut Effort::new(progress));
        let solution = neighbour::from(&self.plan, Some(&self.multipliers), request, effort)?;
        Ok(refine::motion(solution, robot, options, effort))
    }
}

/// [`neighbour::from`], and from scratch if it fails: a request is not infeasible because one plan does not lead to it.
pub(super) fn surely(
    previous: &Plan,
    multipliers: Option<&Multipliers>,
    request: Request<'_>,
    effort: &mut Effort<'_>,
) -> Result<Solution, ReplanError> {
    let Request { robot, motion, options } = request;
    let solution = neighbour::from(previous, multipliers, request, effort)?;
    let from_scratch = Options { start: Start::Auto, refine: false, ..options.clone() };
    let first = candidates(robot, motion, &from_scratch).swap_remove(0);
    let (_, mut solution) =
        second_look(Request { options: &first, ..request }, &OwnEnds, solution, effort);
    if !matches!(solution.plan.solve.status, Status::Infeasible | Status::Stalled) {
        return Ok(solution);
    }
    let search = Search::new(robot, motion, &from_scratch);
    search.work(&mut |state| effort.report(state));
    let mut scratch = search.finish();
    effort.add(&mut scratch.plan.solve.iterations);
    match scratch.plan.solve.status {
        Status::Converged | Status::Interrupted => Ok(scratch),
        _ => {
            solution.plan.solve.iterations = effort.spent;
            Ok(solution)
        }
    }
}
