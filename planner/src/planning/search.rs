//! Search over several starts of one motion, in sequence or on several threads of the caller.
//!
//! The winner is the first candidate in order that converges, regardless of the threads' timing. The same motion and seed
//! therefore always give the same plan. Later candidates stop as soon as an earlier one has won; on one thread they do not even
//! begin. The search ends early if each of the first two candidates finds the request impossible, unless obstacles are in the
//! path.

use super::attempt::attempt;
use super::effort::{Effort, ProgressCallback};
use super::feasibility::search_feasible_values;
use super::refine;
use super::request::{Options, Request};
use super::solution::Solution;
use super::trials::MotionMethods;
use crate::motion::Motion;
use crate::plan::{Diagnosis, Plan, StartOutcome};
use crate::solve::Progress;
use crate::start::{self, Start};
use rollwalk_robot::Robot;
use std::ops::ControlFlow;
use std::sync::{Mutex, MutexGuard, OnceLock, PoisonError};

/// Returns the options of each start that [`optimise`](crate::optimise) tries, in order. If the start is not automatic, it is the
/// only candidate.
pub fn candidates(robot: &Robot, motion: &Motion, options: &Options) -> Vec<Options> {
    let starts = start::in_order(robot, motion, options.start, options.seed);
    starts.into_iter().map(|(start, seed)| Options { start, seed, ..options.clone() }).collect()
}

/// Solves a motion from its first candidate alone. An infeasible request costs no search for feasible values.
pub(crate) fn first_attempt(
    robot: &Robot,
    motion: &Motion,
    options: &Options,
    progress: &mut ProgressCallback<'_>,
) -> Solution {
    let options = &candidates(robot, motion, options).swap_remove(0);
    let effort = &mut Effort::new(&options.structures, progress);
    attempt(Request { robot, motion, options }, effort)
}

/// Search for a plan of one motion over its [`candidates`].
///
/// ```
/// # use rollwalk_planner::{Options, Progress, Search, motion::Motion, plan::Plan};
/// # use rollwalk_robot::Robot;
/// fn on_two_threads(robot: &Robot, motion: &Motion) -> Plan {
///     let search = Search::new(robot, motion, &Options::default());
///     let work = || search.work(&mut |_| std::ops::ControlFlow::Continue(()));
///     std::thread::scope(|scope| {
///         scope.spawn(work);
///         work();
///     });
///     search.finish().plan
/// }
/// ```
pub struct Search<'a> {
    robot: &'a Robot,
    motion: &'a Motion,
    candidates: Vec<Options>,
    race: Race<Solution>,
    /// Plan of the first candidate with its diagnosis, once that candidate has found the request infeasible.
    refusal: OnceLock<Plan>,
}

impl<'a> Search<'a> {
    /// Creates a search. [`Search::work`] runs it.
    pub fn new(robot: &'a Robot, motion: &'a Motion, options: &Options) -> Self {
        let candidates = candidates(robot, motion, options);
        // On each side of an obstacle, another start may find a path.
        let goes_round = candidates.iter().any(|of| matches!(of.start, Start::Detour(_)));
        let hopeless = if goes_round { candidates.len() } else { HOPELESS };
        let race = Race::new(candidates.len(), hopeless);
        Self { robot, motion, candidates, race, refusal: OnceLock::new() }
    }

    /// Returns the number of candidates, which is the largest useful number of threads.
    pub fn candidates(&self) -> usize {
        self.candidates.len()
    }

    /// Returns the plan of the first candidate with its diagnosis, as soon as that candidate has found the request infeasible.
    ///
    /// The diagnosis names the conflicting constraints, without feasible values. The search for feasible values and the other
    /// starts take ten times as long, and may still find a plan.
    pub fn refusal(&self) -> Option<&Plan> {
        self.refusal.get()
    }

    /// Solves candidates until none is left that can still win.
    ///
    /// Call this at least once, and on several threads at once if cores are available. `progress` receives the iterations of
    /// the first candidate that can still win, if this thread solves it, and may stop the search. When a candidate fails, the
    /// iterations of the next one follow. Their count begins at 1, or at its present value if that candidate already runs.
    pub fn work(&self, progress: &mut dyn FnMut(&Progress) -> ControlFlow<()>) {
        self.race.work(progress, &|index, watched| {
            let Self { robot, motion, .. } = *self;
            let options = &self.candidates[index];
            let (request, effort) = (
                Request { robot, motion, options },
                &mut Effort::new(&options.structures, watched),
            );
            let solution = attempt(request, effort);
            let (ending, solution) = if index > 0 {
                (solution.plan.solve.ending(), solution)
            } else {
                // If no candidate converges, the diagnosis of the first candidate is shown.
                if solution.plan.solve.diagnosis.is_some() {
                    let mut plan = solution.plan.clone();
                    plan.solve.diagnosis.iter_mut().for_each(Diagnosis::forget_numbers);
                    self.refusal.get_or_init(|| plan);
                }
                search_feasible_values(request, &MotionMethods, solution, effort)
            };
            (ending, refine::motion(solution, robot, options, effort))
        });
    }

    /// Returns the solution of the winner, or of the first candidate if none converged.
    ///
    /// # Panics
    /// Panics if [`Search::work`] has not been called.
    pub fn finish(self) -> Solution {
        self.race.finish()
    }
}

/// Number of leading candidates that must find a request infeasible before the search ends. If starts lead round obstacles, all
/// must.
const HOPELESS: usize = 2;

/// Race of candidates, each with a result.
struct Race<T>(Mutex<State<T>>);

/// State shared by the threads of a race.
struct State<T> {
    /// Index of the first candidate that has not begun.
    next: usize,
    /// Index of the first candidate that has decided the race. Later candidates do not count.
    winner: Option<usize>,
    /// Flags of the candidates, true for failed ones.
    failed: Vec<bool>,
    /// Number of leading candidates that must find the request infeasible before the race ends.
    hopeless_max: usize,
    /// Number of leading candidates that have found the request infeasible.
    hopeless: usize,
    results: Vec<Option<T>>,
}

impl<T> Race<T> {
    fn new(candidates: usize, hopeless_max: usize) -> Self {
        Self(Mutex::new(State {
            next: 0,
            winner: None,
            failed: vec![false; candidates],
            hopeless_max,
            hopeless: 0,
            results: (0..candidates).map(|_| None).collect(),
        }))
    }

    /// Locks the state. The state is consistent even after a panic of another thread, because no method panics while it has the
    /// lock.
    fn state(&self) -> MutexGuard<'_, State<T>> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Solves candidates until none is left that can still win.
    fn work(
        &self,
        progress: &mut ProgressCallback<'_>,
        solve: &dyn Fn(usize, &mut ProgressCallback<'_>) -> (StartOutcome, T),
    ) {
        loop {
            let begun = self.state().begin();
            let Some(index) = begun else { return };
            let (ending, result) = solve(index, &mut |state| {
                let standing = self.state().standing(index);
                match standing {
                    RacePosition::Lost => ControlFlow::Break(()),
                    RacePosition::Leads => progress(state),
                    RacePosition::Follows => ControlFlow::Continue(()),
                }
            });
            self.state().end(index, ending, result);
        }
    }

    /// Returns the result of the winner, or of the first candidate.
    fn finish(self) -> T {
        let mut state = self.0.into_inner().unwrap_or_else(PoisonError::into_inner);
        let given_up = state.hopeless == state.hopeless_max;
        let chosen = state.winner.filter(|_| !given_up).unwrap_or(0);
        state.results.swap_remove(chosen).expect("the first candidate has run")
    }
}

/// Standing of a running candidate.
enum RacePosition {
    /// An earlier candidate has decided the race.
    Lost,
    /// The candidate is the first that can still win. Exactly one running candidate leads, so that an interrupt always reaches
    /// the race.
    Leads,
    /// An earlier candidate is still running.
    Follows,
}

impl<T> State<T> {
    /// Starts the next candidate and returns its index. `None` if no candidate is left that can still win.
    fn begin(&mut self) -> Option<usize> {
        let index = self.next;
        if index >= self.failed.len() || self.is_decided_before(index) {
            return None;
        }
        self.next += 1;
        Some(index)
    }

    fn is_decided_before(&self, index: usize) -> bool {
        self.winner.is_some_and(|winner| winner < index)
    }

    fn standing(&self, index: usize) -> RacePosition {
        if self.is_decided_before(index) {
            RacePosition::Lost
        } else if self.failed[..index].iter().all(|failed| *failed) {
            RacePosition::Leads
        } else {
            RacePosition::Follows
        }
    }

    /// Records the end of candidate `index`.
    fn end(&mut self, index: usize, ending: StartOutcome, result: T) {
        let hopeless = ending == StartOutcome::Hopeless && index < self.hopeless_max;
        self.hopeless += usize::from(hopeless);
        // A losing candidate that was stopped is after the winner anyway.
        let decided = match ending {
            StartOutcome::Decided => Some(index),
            StartOutcome::Hopeless if hopeless && self.hopeless == self.hopeless_max => {
                Some(self.hopeless_max - 1)
            }
            StartOutcome::Hopeless | StartOutcome::Failed => None,
        };
        match decided {
            Some(index) => self.winner = Some(self.winner.map_or(index, |w| w.min(index))),
            None => self.failed[index] = true,
        }
        self.results[index] = Some(result);
    }
}

#[cfg(test)]
mod tests;
