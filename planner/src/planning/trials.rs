//! Solves of requests that differ from one request in a number, within limits of iterations.

use super::attempt::{attempt, counting_from};
use super::{Options, Request, Solution, replan};
use crate::motion::{Ends, Motion};
use crate::plan::Status;
use crate::solve::{Progress, Settings};
use rollwalk_robot::Robot;
use std::ops::ControlFlow;

/// Callback of a solve after every iteration.
pub(super) type Watched<'a> = dyn FnMut(&Progress) -> ControlFlow<()> + 'a;

/// Ways to solve a request; `None` where there is none.
pub(super) trait Ways {
    /// From its start, as for those who type its numbers.
    fn cold(&self, request: Request<'_>, progress: &mut Watched<'_>) -> Option<Solution>;

    /// From the solution of a neighbour.
    fn near(
        &self,
        known: &Solution,
        request: Request<'_>,
        progress: &mut Watched<'_>,
    ) -> Option<Solution>;
}

/// Those of a motion with periodic or at-rest ends.
pub(super) struct OwnEnds;

impl Ways for OwnEnds {
    fn cold(&self, request: Request<'_>, progress: &mut Watched<'_>) -> Option<Solution> {
        (request.motion.ends != Ends::Prescribed).then(|| attempt(request, progress))
    }

    fn near(
        &self,
        known: &Solution,
        request: Request<'_>,
        progress: &mut Watched<'_>,
    ) -> Option<Solution> {
        let multipliers = known.plan.solve.status == Status::Converged;
        let multipliers = multipliers.then_some(&known.multipliers);
        replan::from(&known.plan, multipliers, request, progress).ok()
    }
}

/// The user has stopped a trial.
pub(super) struct Stopped;

/// Solves of other requests, one after the other.
pub(super) struct Trials<'a, 'p> {
    pub request: Request<'a>,
    pub ways: &'a dyn Ways,
    /// Iterations so far, those before the trials included, and most of all trials.
    pub spent: usize,
    pub left: usize,
    pub progress: &'p mut dyn FnMut(&Progress) -> ControlFlow<()>,
}

impl Trials<'_, '_> {
    /// Solves another request, from a neighbour if there is one, within a limit of iterations, that of the options and
    /// that of all trials; `None` if they leave no iteration, or there is no way.
    pub fn solve(
        &mut self,
        robot: &Robot,
        motion: &Motion,
        neighbour: Option<&Solution>,
        most: usize,
    ) -> Result<Option<Solution>, Stopped> {
        let Request { options, .. } = self.request;
        let iterations = options.settings.iterations.min(most).min(self.left);
        if iterations == 0 {
            return Ok(None);
        }
        let settings = Settings { iterations, ..options.settings.clone() };
        let options = &Options { settings, ..options.clone() };
        let request = Request { robot, motion, options };
        let progress = &mut counting_from(self.spent, self.progress);
        let solution = match neighbour {
            Some(known) => self.ways.near(known, request, progress),
            None => self.ways.cold(request, progress),
        };
        let Some(solution) = solution else { return Ok(None) };
        let spent = solution.plan.solve.iterations;
        self.spent += spent;
        self.left = self.left.saturating_sub(spent);
        match solution.plan.solve.status {
            Status::Interrupted => Err(Stopped),
            _ => Ok(Some(solution)),
        }
    }
}
