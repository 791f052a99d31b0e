//! Planning: computes a plan from a motion goal, or from two motions to be joined.
//!
//! The module combines starts, solver and diagnosis. [`optimise`] tries the candidate starts of a motion in order until one
//! decides the outcome. A [`Search`] does so on all threads that its caller provides. [`Editing`] plans edits one after the
//! other. Each file uses only files above it (`tests/planner/layers.rs`):
//!
//! | file | content |
//! |---|---|
//! | `request`, `solution` | argument and result of every stage |
//! | `structures` | structures of recent solves, which solves of the same pattern share |
//! | `effort` | iterations spent on a request, passed down through all of its solves |
//! | `write` | unknowns to plan |
//! | `probed_solve` | one solve, which is restarted or diagnosed if the constraints cannot be met |
//! | `neighbour` | one solve from a neighbouring plan |
//! | `attempt` | solves from one start, or from the plan with half the samples |
//! | `refine` | solves with more samples if a plan fails the checks as played |
//! | `trials`, `feasibility` | solves with the values that a diagnosis suggests |
//! | `remedy` | advice for a plan that fails its checks |
//! | `search` | attempts from all starts of a motion |
//! | `replan`, `editing`, `transition`, `batch` | other entry points for callers |

mod attempt;
mod batch;
mod editing;
mod effort;
mod feasibility;
mod neighbour;
mod probed_solve;
pub(crate) mod refine;
mod remedy;
mod replan;
mod request;
mod search;
mod solution;
mod structures;
mod transition;
mod trials;
mod write;

pub use batch::{Batch, BatchPlan};
pub use editing::Editing;
pub(crate) use effort::Effort;
pub use neighbour::ReplanError;
pub(crate) use neighbour::{from_near, same_structure};
pub(crate) use replan::refined_solution;
pub use replan::{replan, replan_finer, replan_solution};
pub use request::Options;
pub(crate) use search::first_attempt;
pub use search::{Search, candidates};
pub use solution::Solution;
pub use structures::Structures;
pub use transition::{TransitionError, optimise_transition};
pub(crate) use write::write_plan;

use crate::motion::Motion;
use crate::plan::Plan;
use crate::solve::Progress;
use rollwalk_robot::Robot;
use std::ops::ControlFlow;

/// Optimises a motion with periodic or at-rest ends.
///
/// [`Start::Auto`](crate::start::Start::Auto) tries the [`candidates`] in order. The returned plan is that of the first
/// candidate that converges, or of the first candidate if none converges. A plan that fails the checks as played is refined
/// ([`Options::refine`]). The plan's [`solve`](Plan::solve) summary contains the outcome; a plan that did not converge is
/// returned too, for inspection.
///
/// `progress` is called after every iteration and may stop the solve. Iterations count from 1 for each start. [`Search`] tries
/// several starts in parallel.
pub fn optimise(
    robot: &Robot,
    motion: &Motion,
    options: &Options,
    progress: &mut dyn FnMut(&Progress) -> ControlFlow<()>,
) -> Plan {
    optimise_solution(robot, motion, options, progress).plan
}

/// Optimises as [`optimise`] does, and returns the multipliers as well.
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
