//! Planning after an edit, from the previous plan and, if known, its multipliers.
//!
//! Planners are used most for editing a goal, a duration or a limb and seeing the consequences. A neighbouring plan
//! is nearly optimal, so that a few Gauss-Newton steps without damping complete the solve. Where they do not, the request
//! is planned from scratch before it is called infeasible.

use super::attempt::counting_from;
use super::probed_solve::solve;
use super::second_look::second_look;
use super::trials::OwnEnds;
use super::{Options, Request, Solution, candidates, optimise_solution, refine};
use crate::motion::{Ends, Motion};
use crate::plan::{Plan, StartKind, Started, Status};
use crate::problem::{Problem, Unknowns};
use crate::solve::{Begin, Multipliers, Progress};
use crate::start::{self, Start};
use rollwalk_multibody::euler::Model;
use rollwalk_robot::Robot;
use std::mem::discriminant;
use std::ops::ControlFlow;
use thiserror::Error;

/// Reason for which a plan cannot be the start for another motion.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
pub enum ReplanError {
    /// The robots have different joints or end effectors.
    #[error(
        "the plan of `{motion}` is for robot `{planned}`, whose joints or end effectors are not those of \
         `{wanted}`; plan from scratch, or from a plan of a robot with the same joints and end effectors"
    )]
    OtherStructure {
        /// Motion of the plan.
        motion: String,
        /// Robot of the plan.
        planned: String,
        /// The robot to plan for.
        wanted: String,
    },
    /// The motions have different kinds of ends.
    #[error(
        "the plan of `{planned}` has ends = \"{planned_ends}\", `{wanted}` has \"{wanted_ends}\"; plan from scratch, or from \
         a plan with the same, `periodic` or `at_rest`"
    )]
    OtherEnds {
        /// Motion of the plan.
        planned: String,
        /// Ends of the plan's motion.
        planned_ends: Ends,
        /// The motion to plan.
        wanted: String,
        /// Ends of the motion to plan.
        wanted_ends: Ends,
    },
}

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
    let solution = surely(previous, None, Request { robot, motion, options }, progress)?;
    Ok(refine::motion(solution, robot, options, progress))
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
        let request = Request { robot, motion, options };
        let solution = surely(&self.plan, Some(&self.multipliers), request, progress)?;
        Ok(refine::motion(solution, robot, options, progress))
    }
}

/// [`from`], and from scratch if it fails: a request is not infeasible because one plan does not lead to it.
pub(super) fn surely(
    previous: &Plan,
    multipliers: Option<&Multipliers>,
    request: Request<'_>,
    progress: &mut dyn FnMut(&Progress) -> ControlFlow<()>,
) -> Result<Solution, ReplanError> {
    let Request { robot, motion, options } = request;
    let solution = from(previous, multipliers, request, progress)?;
    let from_scratch = Options { start: Start::Auto, refine: false, ..options.clone() };
    let first = candidates(robot, motion, &from_scratch).swap_remove(0);
    let (_, mut solution) =
        second_look(Request { options: &first, ..request }, &OwnEnds, solution, progress);
    if !matches!(solution.plan.solve.status, Status::Infeasible | Status::Stalled) {
        return Ok(solution);
    }
    let before = solution.plan.solve.iterations;
    let counted = &mut counting_from(before, progress);
    let mut scratch = optimise_solution(robot, motion, &from_scratch, counted);
    scratch.plan.solve.iterations += before;
    match scratch.plan.solve.status {
        Status::Converged | Status::Interrupted => Ok(scratch),
        _ => {
            solution.plan.solve.iterations = scratch.plan.solve.iterations;
            Ok(solution)
        }
    }
}

/// Optimises a motion from the plan of a neighbouring one, and from nothing else.
///
/// # Errors
/// As [`replan`].
pub(super) fn from(
    previous: &Plan,
    multipliers: Option<&Multipliers>,
    request: Request<'_>,
    progress: &mut dyn FnMut(&Progress) -> ControlFlow<()>,
) -> Result<Solution, ReplanError> {
    let Request { robot, motion, options } = request;
    check(previous, robot, motion)?;
    let problem = Problem::new(Model::new(robot), motion, options.weights.clone());
    let unknowns = start::neighbour(&problem, previous);
    Ok(from_near(&problem, motion, unknowns, multipliers, options, progress))
}

/// Checks that a plan can be the start for a motion of a robot.
///
/// # Errors
/// As [`replan`].
pub(super) fn check(previous: &Plan, robot: &Robot, motion: &Motion) -> Result<(), ReplanError> {
    if !same_structure(&previous.robot, robot) {
        return Err(ReplanError::OtherStructure {
            motion: previous.motion.name.clone(),
            planned: previous.robot.name.clone(),
            wanted: robot.name.clone(),
        });
    }
    if previous.motion.ends != motion.ends || motion.ends == Ends::Prescribed {
        return Err(ReplanError::OtherEnds {
            planned: previous.motion.name.clone(),
            planned_ends: previous.motion.ends,
            wanted: motion.name.clone(),
            wanted_ends: motion.ends,
        });
    }
    Ok(())
}

/// Optimises from unknowns near an optimum.
pub(crate) fn from_near(
    problem: &Problem,
    motion: &Motion,
    unknowns: Unknowns,
    multipliers: Option<&Multipliers>,
    options: &Options,
    progress: &mut dyn FnMut(&Progress) -> ControlFlow<()>,
) -> Solution {
    let solved = solve(problem, unknowns, Begin::Near(multipliers), &options.settings, progress);
    solved.write(problem, motion, Started { kind: StartKind::Neighbour, seed: 0 })
}

/// Whether two robots have the same variables: the same joints by name, the same end effectors by name and kind.
pub(crate) fn same_structure(one: &Robot, other: &Robot) -> bool {
    let joints = |robot: &'_ Robot| robot.joints.iter().map(|j| j.name.clone()).collect::<Vec<_>>();
    let ends = one.end_effectors.iter().zip(&other.end_effectors);
    joints(one) == joints(other)
        && one.end_effectors.len() == other.end_effectors.len()
        && ends
            .clone()
            .all(|(a, b)| a.name == b.name && discriminant(&a.contact) == discriminant(&b.contact))
}
