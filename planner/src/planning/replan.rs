//! Planning after an edit, from the previous plan and, if known, its multipliers.
//!
//! Most plans follow an edit of a goal, a duration or a limb. A neighbouring plan is nearly optimal, so that a few iterations
//! complete the solve. If they do not, the request is planned from scratch before it is called infeasible.

use super::effort::Effort;
use super::feasibility::search_feasible_values;
use super::neighbour::{self, ReplanError};
use super::refine;
use super::request::{Options, Request};
use super::search::{Search, candidates};
use super::solution::Solution;
use super::trials::MotionMethods;
use crate::motion::Motion;
use crate::plan::{Plan, Status};
use crate::report::Report;
use crate::solve::{Multipliers, Progress};
use crate::start::Start;
use rollwalk_robot::Robot;
use std::ops::ControlFlow;

/// Optimises a motion from the plan of a neighbouring one.
///
/// `robot` has the same joints and end effectors as the plan's robot; its dimensions may differ. `motion` has the same kind of
/// ends, periodic or at rest; its duration, sample count, goal and footfalls may differ. Start and seed in `options` are
/// ignored. The plan's solve summary contains the outcome, as with [`optimise`](crate::optimise).
///
/// A distant plan may converge more slowly than a cold start. If it does not converge, the motion is planned from scratch.
///
/// # Errors
/// Returns an error if the robots differ in joints or end effectors, if the motions differ in their ends, or if the ends are
/// prescribed.
pub fn replan(
    previous: &Plan,
    robot: &Robot,
    motion: &Motion,
    options: &Options,
    progress: &mut dyn FnMut(&Progress) -> ControlFlow<()>,
) -> Result<Plan, ReplanError> {
    Ok(replan_solution(previous, robot, motion, options, progress)?.plan)
}

/// Plans the motion of a plan with twice its samples, starting from that plan. Returns `None` if the samples would be too many
/// or too close, or if no consistent plan is found.
pub fn replan_finer(
    plan: &Plan,
    options: &Options,
    progress: &mut dyn FnMut(&Progress) -> ControlFlow<()>,
) -> Option<Plan> {
    let finer = refine::doubled(&plan.motion)?;
    let mut found = replan(plan, &plan.robot, &finer, options, progress).ok()?;
    found.solve.start = plan.solve.start;
    found.solve.timing.clone_from(&plan.solve.timing);
    found.solve.refinements.splice(0..0, plan.solve.refinements.iter().cloned());
    let is_solved = found.solve.status.is_solved();
    (is_solved && Report::as_played(&found).judgement.is_good()).then_some(found)
}

/// Plans as [`replan`] does, and returns the multipliers as well.
///
/// # Errors
/// Returns an error in the same cases as [`replan`].
pub fn replan_solution(
    previous: &Plan,
    robot: &Robot,
    motion: &Motion,
    options: &Options,
    progress: &mut dyn FnMut(&Progress) -> ControlFlow<()>,
) -> Result<Solution, ReplanError> {
    let solve = |request: Request<'_>, effort: &mut Effort<'_>| {
        replan_or_plan(previous, None, request, effort)
    };
    refined(Request { robot, motion, options }, progress, solve)
}

impl Solution {
    /// Plans as [`replan`] does, and also starts with the multipliers of this solution if the constraints of the motion have
    /// the same pattern.
    ///
    /// # Errors
    /// Returns an error if the robots differ in joints or end effectors, if the motions differ in their ends, or if the ends are
    /// prescribed.
    pub fn replan(
        &self,
        robot: &Robot,
        motion: &Motion,
        options: &Options,
        progress: &mut dyn FnMut(&Progress) -> ControlFlow<()>,
    ) -> Result<Self, ReplanError> {
        let solve = |request: Request<'_>, effort: &mut Effort<'_>| {
            replan_or_plan(&self.plan, Some(&self.multipliers), request, effort)
        };
        refined(Request { robot, motion, options }, progress, solve)
    }

    /// Plans as [`Self::replan`] does, but from this solution alone. If that fails, no other start is tried.
    ///
    /// # Errors
    /// Returns an error in the same cases as [`Self::replan`].
    pub fn replan_near(
        &self,
        robot: &Robot,
        motion: &Motion,
        options: &Options,
        progress: &mut dyn FnMut(&Progress) -> ControlFlow<()>,
    ) -> Result<Self, ReplanError> {
        let solve = |request: Request<'_>, effort: &mut Effort<'_>| {
            neighbour::from(&self.plan, Some(&self.multipliers), request, effort)
        };
        refined(Request { robot, motion, options }, progress, solve)
    }
}

/// Refines the samples of a solution if it fails the checks as played.
pub(crate) fn refined_solution(
    solution: Solution,
    options: &Options,
    progress: &mut dyn FnMut(&Progress) -> ControlFlow<()>,
) -> Solution {
    let robot = solution.plan.robot.clone();
    let mut effort = Effort::new(&options.structures, progress);
    effort.spent = solution.plan.solve.iterations;
    refine::motion(solution, &robot, options, &mut effort)
}

/// Solves a request, and refines the samples of the solution if necessary.
fn refined(
    request: Request<'_>,
    progress: &mut dyn FnMut(&Progress) -> ControlFlow<()>,
    solve: impl FnOnce(Request<'_>, &mut Effort<'_>) -> Result<Solution, ReplanError>,
) -> Result<Solution, ReplanError> {
    let effort = &mut Effort::new(&request.options.structures, progress);
    let solution = solve(request, effort)?;
    Ok(refine::motion(solution, request.robot, request.options, effort))
}

/// Runs [`neighbour::from`]. If that fails, plans from scratch, because a failure from one plan does not prove the request
/// infeasible.
pub(super) fn replan_or_plan(
    previous: &Plan,
    multipliers: Option<&Multipliers>,
    request: Request<'_>,
    effort: &mut Effort<'_>,
) -> Result<Solution, ReplanError> {
    let Request { robot, motion, options } = request;
    let solution = neighbour::from(previous, multipliers, request, effort)?;
    let from_scratch = Options { start: Start::Auto, refine: false, ..options.clone() };
    let first = candidates(robot, motion, &from_scratch).swap_remove(0);
    let (_, mut solution) = search_feasible_values(
        Request { options: &first, ..request },
        &MotionMethods,
        solution,
        effort,
    );
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
