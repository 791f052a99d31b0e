//! Choice of the times of a motion whose file leaves them free ([`Timing`](crate::motion::Timing)).
//!
//! Samples stay equidistant, and footfalls change at samples. The times are therefore a few whole numbers: library frames of the
//! whole motion, and samples of each stance and swing. The search solves a motion for each combination that it tries, mostly
//! from a neighbouring solution in a few iterations, and follows the prices of the times
//! ([`TimingPrices`](crate::sensitivity::TimingPrices)).
//!
//! 1. **Duration.** If the motion is infeasible as given, longer ones are tried. Otherwise the cheapest duration is where the
//!    price of the duration is zero, or at a bound.
//! 2. **Footfalls**, if they are free too. If no duration leads to a plan, longer swings are tried. Otherwise the swings of all
//!    feet, and single lift-offs and touch-downs, move by one sample in the order of their prices, as long as the costs fall.
//! 3. **As played.** Cheap plans may slip when they are played. A timing is chosen only if its plan passes the checks as played,
//!    and about as well as the plan with the given times.

mod candidates;
mod duration;
mod edits;
mod footfalls;

use crate::motion::{FreeTimes, Motion};
use crate::plan::TimingChoice;
use crate::planning::{Options, Solution, first_attempt, optimise_solution, refined_solution};
use crate::report::Report;
use crate::solve::{Method, Progress};
use candidates::{Candidates, Choice};
use rollwalk_robot::Robot;
use std::ops::ControlFlow;

/// Optimises a motion with its free times. Motions with given times are planned as by
/// [`optimise_solution`](crate::optimise_solution), and so is a motion without a plan for any times within the bounds.
pub fn optimise(
    robot: &Robot,
    motion: &Motion,
    options: &Options,
    progress: &mut dyn FnMut(&Progress) -> ControlFlow<()>,
) -> Solution {
    let chosen = choose(robot, motion, options, progress);
    chosen.unwrap_or_else(|| optimise_solution(robot, motion, options, progress))
}

/// Chooses the free times of a motion, and returns its plan with them. Returns `None` if the times are given, if the method has
/// no multipliers, or if no times within the bounds lead to a plan. The plan with given times then has a diagnosis.
///
/// The callback may stop the search, which then returns the best plan so far.
pub fn choose(
    robot: &Robot,
    motion: &Motion,
    options: &Options,
    progress: &mut dyn FnMut(&Progress) -> ControlFlow<()>,
) -> Option<Solution> {
    if motion.timing.is_given() {
        return None;
    }
    if options.settings.method != Method::GaussNewton {
        // Without multipliers, times have no prices.
        return None;
    }
    let mut candidates = Candidates::new(robot, motion, options, progress);
    duration::search(&mut candidates, motion);
    let mut with_given_footfalls = None;
    if motion.timing.free == FreeTimes::Free {
        with_given_footfalls = candidates.best().map(|best| {
            let score = candidates.score(best);
            (candidates.at(best).solution.clone(), score)
        });
        footfalls::search(&mut candidates);
    }
    let tried = candidates.tried();
    let mut choice = candidates.finish()?;
    if !choice.holds {
        let refined = refined_solution(choice.solution.clone(), options, progress);
        choice.refine(refined);
    }
    // Edited footfalls may fail with any number of samples where the given ones only need more.
    if let Some((unedited, score)) = with_given_footfalls.filter(|_| !choice.holds) {
        let refined = refined_solution(unedited, options, progress);
        if Report::as_played(&refined.plan).judgement.is_good() {
            choice.refine(refined);
            choice.score = score;
        }
    }
    let Choice { mut solution, score, given, .. } = choice;
    solution.plan.solve.timing = Some(TimingChoice {
        given_duration_s: motion.duration_s,
        given_stance: motion.stance.clone(),
        given,
        chosen: score,
        tried,
    });
    Some(solution)
}

/// Plans a motion from its first start, with its free times, and without a diagnosis. `None` if that start leads to no plan,
/// or if the callback stopped the solve.
pub fn attempt(
    robot: &Robot,
    motion: &Motion,
    options: &Options,
    progress: &mut dyn FnMut(&Progress) -> ControlFlow<()>,
) -> Option<Solution> {
    if !motion.timing.is_given() {
        return choose(robot, motion, options, progress);
    }
    let solution = first_attempt(robot, motion, options, progress);
    let solution = refined_solution(solution, options, progress);
    solution.plan.solve.status.is_solved().then_some(solution)
}
