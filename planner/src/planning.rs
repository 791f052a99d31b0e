//! Planning: from a motion goal, or from two motions to be joined, to a plan.
//!
//! The only module that knows starts, solver and diagnosis. [`optimise`] tries the candidate starts of a motion
//! in order until one decides; a [`Search`] does the same on as many threads as its caller has. Each attempt is
//! one solve from one start, or from the plan with half the samples; `probed_solve` watches a solve and decides
//! on restart and diagnosis, and `second_look` tries what the diagnosis says. [`Editing`] plans edits one after the other. `refine` judges what is played of a plan
//! and plans with more samples where that fails.

mod attempt;
mod coarse;
mod editing;
mod kept;
mod probed_solve;
pub(crate) mod refine;
mod replan;
mod search;
mod second_look;
mod transition;
mod trials;
mod write;

pub use editing::Editing;
pub use replan::{ReplanError, replan, replan_solution};
pub(crate) use replan::{from_near, same_structure};
pub use search::Search;
pub use transition::{TransitionError, optimise_transition};
pub(crate) use write::write_plan;

use crate::motion::Motion;
use crate::plan::Plan;
use crate::problem::Weights;
use crate::solve::{Multipliers, Progress, Settings};
use crate::start::{self, Start};
use rollwalk_robot::Robot;
use std::ops::ControlFlow;

/// Options of the optimisation.
#[derive(Clone, Debug, PartialEq)]
pub struct Options {
    /// Weights of the formulation.
    pub weights: Weights,
    /// Settings of the solver.
    pub settings: Settings,
    /// Starting point.
    pub start: Start,
    /// Seed of all random numbers in the start.
    pub seed: u64,
    /// Whether a plan that does not hold as it is played is planned again with more samples. Without, the samples are
    /// those of the motion, and [`Report`](crate::report::Report) alone tells what the plan is worth.
    pub refine: bool,
}

impl Default for Options {
    fn default() -> Self {
        Self {
            weights: Weights::default(),
            settings: Settings::default(),
            start: Start::default(),
            seed: 0,
            refine: true,
        }
    }
}

/// A motion of a robot, with one start.
#[derive(Clone, Copy)]
struct Request<'a> {
    robot: &'a Robot,
    motion: &'a Motion,
    options: &'a Options,
}

/// A plan with its multipliers, from which [`replan`] starts best.
#[derive(Clone, Debug, PartialEq)]
pub struct Solution {
    /// The plan.
    pub plan: Plan,
    /// The multipliers of its constraints.
    pub multipliers: Multipliers,
}

/// Optimises a motion with periodic or at-rest ends.
///
/// With [`Start::Auto`] it tries the [`candidates`] in order; the plan is that of the first that converges, or of the
/// first candidate if none does. A plan that does not hold as it is played is refined ([`Options::refine`]). The outcome is in the plan's [`solve`](Plan::solve) summary; a plan that did not
/// converge is returned too, for inspection. `progress` sees every iteration of one start after the other, each counted
/// from 1, and may stop the solve. [`Search`] tries several starts in parallel.
pub fn optimise(
    robot: &Robot,
    motion: &Motion,
    options: &Options,
    progress: &mut dyn FnMut(&Progress) -> ControlFlow<()>,
) -> Plan {
    optimise_solution(robot, motion, options, progress).plan
}

/// Does the same as [`optimise`] and returns the multipliers too.
pub fn optimise_solution(
    robot: &Robot,
    motion: &Motion,
    options: &Options,
    progress: &mut dyn FnMut(&Progress) -> ControlFlow<()>,
) -> Solution {
    let search = Search::new(robot, motion, options);
    search.work(progress);
    search.finish()
}

/// Options of every start that [`optimise`] tries, in order; a chosen start is the only one.
pub fn candidates(robot: &Robot, motion: &Motion, options: &Options) -> Vec<Options> {
    let starts = start::in_order(robot, motion, options.start, options.seed);
    starts.into_iter().map(|(start, seed)| Options { start, seed, ..options.clone() }).collect()
}
