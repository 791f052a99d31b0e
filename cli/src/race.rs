//! Several starts of one motion at once, on as many cores as there are.
//!
//! The winner is the first in the candidates' order that converges, whatever the threads' timing, so that the
//! same motion and seed always give the same plan. Later candidates stop as soon as an earlier one has won,
//! and on one core they are not even begun. A request that looks impossible from the first two is given up.

use rollwalk_planner::motion::Motion;
use rollwalk_planner::plan::{Ending, Plan};
use rollwalk_planner::{Options, Progress, optimise, start};
use rollwalk_robot::Robot;
use std::ops::ControlFlow;
use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::thread;

/// Optimises a motion from its candidate starts. `progress` sees the iterations of the first one that
/// can still win, and may stop them all. If none decides the plan is that of the first.
pub fn optimise_any(
    robot: &Robot,
    motion: &Motion,
    options: &Options,
    progress: &(dyn Fn(&Progress) -> ControlFlow<()> + Sync),
) -> Plan {
    let candidates = start::candidates(robot, motion, options);
    let cores = thread::available_parallelism().map_or(1, usize::from);
    first_that_decides(candidates.len(), cores, progress, &|index, watched| {
        let plan = optimise(robot, motion, &candidates[index], watched);
        (plan.solve.ending(), plan)
    })
}

/// What a solve calls after every iteration.
type Watched<'a> = dyn FnMut(&Progress) -> ControlFlow<()> + 'a;

/// Runs solves 0 to `count` on up to `workers` threads and returns what the first that decides the race
/// brings; that of the first if none does.
fn first_that_decides<T: Send>(
    count: usize,
    workers: usize,
    progress: &(dyn Fn(&Progress) -> ControlFlow<()> + Sync),
    solve: &(dyn Fn(usize, &mut Watched) -> (Ending, T) + Sync),
) -> T {
    let race = Race {
        next: AtomicUsize::new(0),
        winner: AtomicUsize::new(usize::MAX),
        failed: (0..count).map(|_| AtomicBool::new(false)).collect(),
        hopeless: AtomicUsize::new(0),
    };
    let results: Mutex<Vec<Option<T>>> = Mutex::new((0..count).map(|_| None).collect());
    let run = || {
        loop {
            let index = race.next.fetch_add(1, Ordering::SeqCst);
            if index >= count || race.is_decided_before(index) {
                return;
            }
            let (ending, result) = solve(index, &mut |state| {
                if race.is_decided_before(index) {
                    ControlFlow::Break(())
                } else if race.leads(index) {
                    progress(state)
                } else {
                    ControlFlow::Continue(())
                }
            });
            race.finished(index, ending);
            if let Ok(mut results) = results.lock() {
                results[index] = Some(result);
            }
        }
    };
    thread::scope(|scope| {
        for _ in 1..workers.min(count) {
            scope.spawn(run);
        }
        run();
    });
    let winner = race.winner.into_inner();
    let mut results = results.into_inner().unwrap_or_default();
    let given_up = race.hopeless.into_inner() == HOPELESS;
    let chosen = if winner < results.len() && !given_up { winner } else { 0 };
    // Candidate 0 is always begun, and a winner has a result.
    results.swap_remove(chosen).expect("every candidate that counts has run")
}

/// Candidates from which a request must look impossible before it is given up.
pub const HOPELESS: usize = 2;

/// What the threads of a race share.
struct Race {
    /// First candidate that nobody has begun.
    next: AtomicUsize,
    /// First candidate that has decided the race: none after it counts.
    winner: AtomicUsize,
    /// Which candidates have failed.
    failed: Vec<AtomicBool>,
    /// How many of the first [`HOPELESS`] candidates have found the request impossible.
    hopeless: AtomicUsize,
}

impl Race {
    /// Whether a candidate before `index` has decided the race.
    fn is_decided_before(&self, index: usize) -> bool {
        self.winner.load(Ordering::SeqCst) < index
    }

    /// Whether `index` is the first that can still win: exactly one running candidate does, so that
    /// somebody always hears of an interrupt.
    fn leads(&self, index: usize) -> bool {
        self.failed[..index].iter().all(|failed| failed.load(Ordering::SeqCst))
    }

    /// Candidate `index` has ended.
    fn finished(&self, index: usize, ending: Ending) {
        let is_hopeless = ending == Ending::Hopeless && index < HOPELESS;
        let all_hopeless =
            is_hopeless && self.hopeless.fetch_add(1, Ordering::SeqCst) + 1 == HOPELESS;
        // A loser that was stopped is behind the winner already.
        let winner = match ending {
            Ending::Decided => Some(index),
            Ending::Hopeless if all_hopeless => Some(HOPELESS - 1),
            Ending::Hopeless | Ending::Failed => None,
        };
        match winner {
            Some(winner) => {
                self.winner.fetch_min(winner, Ordering::SeqCst);
            }
            None => self.failed[index].store(true, Ordering::SeqCst),
        }
    }
}

#[cfg(test)]
mod tests;
