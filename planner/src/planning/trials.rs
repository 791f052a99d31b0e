//! Solves of requests that differ from a given request in one value, within iteration limits.

use super::attempt::attempt;
use super::effort::Effort;
use super::neighbour;
use super::request::{Options, Request};
use super::solution::Solution;
use crate::motion::{Ends, Motion};
use crate::plan::Status;
use crate::solve::Settings;
use rollwalk_robot::Robot;

/// Ways to solve a request. A method returns `None` if it does not apply.
pub(super) trait SolveMethods {
    /// Solves from the start in the request, as for a user who enters its values.
    fn cold(&self, request: Request<'_>, effort: &mut Effort<'_>) -> Option<Solution>;

    /// Solves from the solution of a neighbouring request.
    fn near(
        &self,
        known: &Solution,
        request: Request<'_>,
        effort: &mut Effort<'_>,
    ) -> Option<Solution>;
}

/// Solves of a motion with periodic or at-rest ends.
pub(super) struct MotionMethods;

impl SolveMethods for MotionMethods {
    fn cold(&self, request: Request<'_>, effort: &mut Effort<'_>) -> Option<Solution> {
        (request.motion.ends != Ends::Prescribed).then(|| attempt(request, effort))
    }

    fn near(
        &self,
        known: &Solution,
        request: Request<'_>,
        effort: &mut Effort<'_>,
    ) -> Option<Solution> {
        let multipliers = known.plan.solve.status == Status::Converged;
        let multipliers = multipliers.then_some(&known.multipliers);
        neighbour::from(&known.plan, multipliers, request, effort).ok()
    }
}

/// Error: the user has stopped a trial.
pub(super) struct Interrupted;

/// Solves of changed requests, one after the other.
pub(super) struct Trials<'a, 'p> {
    pub request: Request<'a>,
    pub ways: &'a dyn SolveMethods,
    pub effort: &'a mut Effort<'p>,
    /// Total effort at which trials end, iterations.
    pub most: usize,
}

impl Trials<'_, '_> {
    /// Solves another request, from a neighbour if given.
    ///
    /// `most` limits the iterations, and so do the options and the remaining effort. Returns `None` if no iteration is left, or
    /// if the request cannot be solved in this way.
    pub fn solve(
        &mut self,
        robot: &Robot,
        motion: &Motion,
        neighbour: Option<&Solution>,
        most: usize,
    ) -> Result<Option<Solution>, Interrupted> {
        let Request { options, .. } = self.request;
        let left = self.most.saturating_sub(self.effort.spent);
        let iterations = options.settings.iterations.min(most).min(left);
        if iterations == 0 {
            return Ok(None);
        }
        let settings = Settings { iterations, ..options.settings.clone() };
        let options = &Options { settings, ..options.clone() };
        let request = Request { robot, motion, options };
        let solution = match neighbour {
            Some(known) => self.ways.near(known, request, self.effort),
            None => self.ways.cold(request, self.effort),
        };
        if self.effort.interrupted { Err(Interrupted) } else { Ok(solution) }
    }
}
