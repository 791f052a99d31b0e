//! Repeated planning while a robot or a motion is edited, as with a slider.
//!
//! Each re-plan starts from the last converged plan and its multipliers, with the structure of the last solve
//! ([`Structures`](super::Structures)). If few iterations do not suffice, the edit is planned as by [`replan`](super::replan()).
//!
//! The first Gauss-Newton step of a re-plan approximates the derivative of the plan with respect to the robot (thesis 2.5.1).
//! The step solves the rows of the edited problem at the old plan with their own matrix. It neglects second derivatives of the
//! constraints and changes of the multipliers, which later iterations correct. [`crate::sensitivity`] has exact derivatives.

use super::effort::Effort;
use super::neighbour::{self, ReplanError, check};
use super::refine;
use super::replan::replan_or_plan;
use super::request::{Options, Request};
use super::solution::Solution;
use crate::motion::Motion;
use crate::plan::Status;
use crate::solve::{Method, Progress, Settings};
use rollwalk_robot::Robot;
use std::ops::ControlFlow;

/// Iteration limit of a re-plan from the last solution. Half of all edits by 10 mm take two or three iterations.
const MOST_ITERATIONS: usize = 60;

/// Motion that is planned for one edited robot after the other.
///
/// ```
/// # use rollwalk_planner::{Editing, Options, ReplanError, Solution, motion::Motion, plan::Plan};
/// # use rollwalk_robot::Robot;
/// fn dragged(
///     solution: Solution,
///     motion: &Motion,
///     robots: impl Iterator<Item = Robot>,
/// ) -> Result<Vec<Plan>, ReplanError> {
///     let mut editing = Editing::new(solution, &Options { refine: false, ..Options::default() });
///     let on = &mut |_: &_| std::ops::ControlFlow::Continue(());
///     robots.map(|robot| Ok(editing.replan(&robot, motion, on)?.plan)).collect()
/// }
/// ```
#[derive(Debug)]
pub struct Editing {
    options: Options,
    /// Last converged solution, before refinement, so that its samples are those of the request.
    solution: Solution,
}

impl Editing {
    /// Begins at a solution. `options` apply to all edits; their start and seed are ignored.
    pub fn new(solution: Solution, options: &Options) -> Self {
        Self { options: options.clone(), solution }
    }

    /// Returns the last converged solution, from which the next edit is planned. Before any edit has converged, this is the
    /// solution passed to [`Editing::new`].
    pub fn last(&self) -> &Solution {
        &self.solution
    }

    /// Plans the motion of an edited robot, or an edited motion.
    ///
    /// The plan is refined if [`Options::refine`] is set, and its solve summary contains the outcome. A plan that did not
    /// converge is not used as the start of the next edit.
    ///
    /// # Errors
    /// Returns an error if the robot has other joints or end effectors, or if the motion has other ends.
    pub fn replan(
        &mut self,
        robot: &Robot,
        motion: &Motion,
        progress: &mut dyn FnMut(&Progress) -> ControlFlow<()>,
    ) -> Result<Solution, ReplanError> {
        let Self { options, solution: previous } = self;
        check(&previous.plan, robot, motion)?;
        let effort = &mut Effort::new(&options.structures, progress);
        let mut solution = None;
        let Settings { method, iterations, .. } = options.settings;
        if previous.plan.solve.status.is_solved() && method == Method::GaussNewton {
            let settings = Settings {
                iterations: iterations.min(MOST_ITERATIONS),
                ..options.settings.clone()
            };
            let few = &Options { settings, ..options.clone() };
            let (known, request) =
                (Some(&previous.multipliers), Request { robot, motion, options: few });
            let near = neighbour::from(&previous.plan, known, request, effort)?;
            // A plan at the caller's limit of iterations is complete as well.
            let ends = [Status::Converged, Status::Interrupted];
            let is_all = near.plan.solve.iterations >= iterations;
            solution = (is_all || ends.contains(&near.plan.solve.status)).then_some(near);
        }
        let solution = match solution {
            Some(solution) => solution,
            None => {
                // Multipliers of a robot that is not similar are misleading.
                let request = Request { robot, motion, options };
                replan_or_plan(&previous.plan, None, request, effort)?
            }
        };
        if solution.plan.solve.status == Status::Converged {
            self.solution = solution.clone();
        }
        Ok(refine::motion(solution, robot, &self.options, effort))
    }
}

#[cfg(test)]
mod tests;
