//! Planning: from a motion goal, or from two motions to be joined, to a plan.
//!
//! The only module that knows starts, solver and diagnosis. [`optimise`] tries the candidate starts of a motion
//! in order until one decides; a [`Search`] does the same on as many threads as its caller has. [`Editing`] plans edits one
//! after the other. Each file uses those before it only (`tests/planner/layers.rs`):
//!
//! | file | content |
//! |---|---|
//! | `request`, `solution` | argument and result of every stage |
//! | `effort` | iterations spent on a request, passed down through all of its solves |
//! | `write` | unknowns to plan |
//! | `probed_solve` | one solve, which is restarted or diagnosed where constraints cannot be met |
//! | `neighbour` | one solve from a neighbouring plan |
//! | `attempt` | solves from one start, or from the plan with half the samples |
//! | `trials`, `second_look` | solves with the numbers that a diagnosis suggests |
//! | `refine` | solves with more samples where a plan fails as it is played |
//! | `search` | attempts from all starts of a motion |
//! | `replan`, `editing`, `transition` | what callers ask for besides |

mod attempt;
mod editing;
mod effort;
mod neighbour;
mod probed_solve;
pub(crate) mod refine;
mod replan;
mod request;
mod search;
mod second_look;
mod solution;
mod transition;
mod trials;
mod write;

pub use editing::Editing;
pub(crate) use effort::Effort;
pub use neighbour::ReplanError;
pub(crate) use neighbour::{from_near, same_structure};
pub use replan::{replan, replan_finer, replan_solution};
pub use request::Options;
pub use search::{Search, candidates};
pub use solution::Solution;
pub use transition::{TransitionError, optimise_transition};
pub(crate) use write::write_plan;

use crate::motion::Motion;
use crate::plan::Plan;
use crate::solve::Progress;
use rollwalk_robot::Robot;
use std::ops::ControlFlow;

/// Optimises a motion with periodic or at-rest ends.
///
/// With [`Start::Auto`](crate::start::Start::Auto) it tries the [`candidates`] in order; the plan is that of the first that
/// converges, or of the first candidate if none does. A plan that does not hold as it is played is refined
/// ([`Options::refine`]). The outcome is in the plan's [`solve`](Plan::solve) summary; a plan that did not converge is
/// returned too, for inspection. `progress` sees every iteration of one start after the other, each counted from 1, and
/// may stop the solve. [`Search`] tries several starts in parallel.
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
