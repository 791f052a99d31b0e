//! Planning from a neighbouring plan and, if known, its multipliers.
//!
//! A neighbouring plan is nearly optimal. A few undamped Gauss-Newton steps complete the solve.

use super::effort::Effort;
use super::probed_solve::solve;
use super::request::{Options, Request};
use super::solution::Solution;
use crate::motion::{Ends, Motion};
use crate::plan::{Plan, SolveStart, StartKind};
use crate::problem::{Problem, Unknowns};
use crate::solve::{Multipliers, SolveMode};
use crate::start;
use rollwalk_robot::Robot;
use std::mem::discriminant;
use thiserror::Error;

/// Reason why a plan cannot be the starting point of another motion.
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
        /// Robot to plan for.
        wanted: String,
    },
    /// The motions have different kinds of ends.
    #[error(
        "the plan of `{planned}` has ends = \"{planned_ends}\", but `{wanted}` has ends = \
         \"{wanted_ends}\"; plan from scratch, or from a plan with the same ends"
    )]
    OtherEnds {
        /// Motion of the plan.
        planned: String,
        /// Ends of the plan's motion.
        planned_ends: Ends,
        /// Motion to plan.
        wanted: String,
        /// Ends of the motion to plan.
        wanted_ends: Ends,
    },
}

/// Optimises a motion from the plan of a neighbouring one, without trying other starts.
///
/// # Errors
/// Returns an error if [`check`] refuses the plan.
pub(super) fn from(
    previous: &Plan,
    multipliers: Option<&Multipliers>,
    request: Request<'_>,
    effort: &mut Effort<'_>,
) -> Result<Solution, ReplanError> {
    let Request { robot, motion, options } = request;
    check(previous, robot, motion)?;
    let problem = Problem::new(motion.model(robot), motion, options.weights.clone());
    let unknowns = start::neighbour(&problem, previous);
    Ok(from_near(&problem, motion, unknowns, multipliers, options, effort))
}

/// Checks that a plan can be the starting point of a motion of a robot.
///
/// # Errors
/// Returns an error if the robots differ in joints or end effectors, if the motions differ in their ends, or if the ends are
/// prescribed.
pub(super) fn check(previous: &Plan, robot: &Robot, motion: &Motion) -> Result<(), ReplanError> {
    if !same_structure(&previous.robot, &motion.robot(robot)) {
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
    effort: &mut Effort<'_>,
) -> Solution {
    let solved = solve(problem, unknowns, SolveMode::Near(multipliers), &options.settings, effort);
    solved.write(problem, motion, SolveStart { kind: StartKind::Neighbour, seed: 0 })
}

/// True if two robots have the same variables: joints of the same names, and end effectors of the same names and kinds.
pub(crate) fn same_structure(one: &Robot, other: &Robot) -> bool {
    let joints = |robot: &'_ Robot| robot.joints.iter().map(|j| j.name.clone()).collect::<Vec<_>>();
    let ends = one.end_effectors.iter().zip(&other.end_effectors);
    joints(one) == joints(other)
        && one.end_effectors.len() == other.end_effectors.len()
        && ends
            .clone()
            .all(|(a, b)| a.name == b.name && discriminant(&a.contact) == discriminant(&b.contact))
}
