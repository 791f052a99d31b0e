//! Several starts of one motion at once, on as many cores as there are.
//!
//! The winner is the first in the candidates' order that converges, whatever the threads' timing, so that
//! the same motion and seed always give the same plan. Later candidates stop as soon as an earlier one
//! has converged, and on one core they are not even begun.

use rollwalk_planner::motion::Motion;
use rollwalk_planner::plan::{Plan, Status};
use rollwalk_planner::{Options, Progress, optimise, start};
use rollwalk_robot::Robot;
use std::ops::ControlFlow;
use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::thread;

/// Optimises a motion from its candidate starts. `progress` sees the iterations of the first one that
/// can still win, and may stop them all. If none converges the plan is that of the first.
pub fn optimise_any(
    robot: &Robot,
    motion: &Motion,
    options: &Options,
    progress: &(dyn Fn(&Progress) -> ControlFlow<()> + Sync),
) -> Plan {
    let candidates = start::candidates(robot, motion, options);
    let race = Race {
        next: AtomicUsize::new(0),
        winner: AtomicUsize::new(usize::MAX),
        leader: AtomicUsize::new(0),
    };
    let plans: Mutex<Vec<Option<Plan>>> = Mutex::new(vec![None; candidates.len()]);
    let run = || {
        loop {
            let index = race.next.fetch_add(1, Ordering::SeqCst);
            let Some(candidate) = candidates.get(index) else { return };
            if race.winner.load(Ordering::SeqCst) < index {
                return;
            }
            let mut watched = |state: &Progress| {
                let watched = race.leader.load(Ordering::SeqCst) == index;
                if race.winner.load(Ordering::SeqCst) < index {
                    return ControlFlow::Break(());
                }
                if watched { progress(state) } else { ControlFlow::Continue(()) }
            };
            let plan = optimise(robot, motion, candidate, &mut watched);
            race.finished(index, plan.solve.status);
            if let Ok(mut plans) = plans.lock() {
                plans[index] = Some(plan);
            }
        }
    };
    let workers = thread::available_parallelism().map_or(1, usize::from).min(candidates.len());
    thread::scope(|scope| {
        for _ in 1..workers {
            scope.spawn(run);
        }
        run();
    });
    let winner = race.winner.into_inner();
    let mut plans = plans.into_inner().unwrap_or_default();
    let chosen = if winner < plans.len() { winner } else { 0 };
    // Candidate 0 is always begun, and a winner has a plan.
    plans.swap_remove(chosen).expect("every candidate that counts has run")
}

/// What the threads of a race share.
struct Race {
    /// First candidate that nobody has begun.
    next: AtomicUsize,
    /// First candidate that has decided the race: none after it counts.
    winner: AtomicUsize,
    /// First candidate that has not failed, as far as is known.
    leader: AtomicUsize,
}

impl Race {
    /// Candidate `index` has ended. An interrupt ends the race like a victory.
    fn finished(&self, index: usize, status: Status) {
        match status {
            // A loser that was stopped is behind the winner already.
            Status::Converged | Status::Interrupted => {
                self.winner.fetch_min(index, Ordering::SeqCst);
            }
            Status::Infeasible | Status::Stalled | Status::IterationLimit => {
                self.leader.fetch_max(index + 1, Ordering::SeqCst);
            }
        }
    }
}
