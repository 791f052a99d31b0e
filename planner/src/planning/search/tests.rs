//! Races of simulated solves with prescribed outcome and timing, and of real solves.

use super::*;
use crate::families::Family;
use crate::plan::Status;
use crate::planning::{optimise, optimise_solution};
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::mpsc;
use std::thread;

const STATE: Progress = Progress {
    iteration: 1,
    energy: 1.0,
    cost: 1.0,
    worst_level: 1.0,
    worst_constraint: Family::Slip,
    damping: 0.0,
    step: 0.0,
};

fn go_on(_: &Progress) -> ControlFlow<()> {
    ControlFlow::Continue(())
}

/// Runs a race on `workers` threads and returns its result.
fn first_that_decides<T: Send>(
    count: usize,
    workers: usize,
    progress: &(dyn Fn(&Progress) -> ControlFlow<()> + Sync),
    solve: &(dyn Fn(usize, &mut ProgressCallback<'_>) -> (StartOutcome, T) + Sync),
) -> T {
    let race = Race::new(count, HOPELESS);
    let work = || race.work(&mut |state| progress(state), solve);
    thread::scope(|scope| {
        for _ in 1..workers {
            scope.spawn(work);
        }
        work();
    });
    race.finish()
}

/// Iterates until the callback stops it.
fn until_stopped(watched: &mut ProgressCallback<'_>) -> StartOutcome {
    while watched(&STATE).is_continue() {
        thread::yield_now();
    }
    StartOutcome::Decided
}

#[test]
fn the_first_in_order_wins_with_any_number_of_threads() {
    use StartOutcome::{Decided, Failed, Hopeless};
    for (endings, winner) in [
        (&[Decided, Decided, Decided][..], 0),
        (&[Failed, Decided, Decided], 1),
        (&[Failed, Failed, Hopeless, Decided], 3),
        (&[Failed, Failed, Failed], 0),
        (&[Decided], 0),
        // One hopeless start is not enough, two are, independent of the others. The first gives the reason.
        (&[Hopeless, Decided, Decided], 1),
        (&[Hopeless, Failed, Decided], 2),
        (&[Hopeless, Hopeless, Decided], 0),
        (&[Hopeless], 0),
    ] {
        for workers in 1..6 {
            let solve = |index: usize, _: &mut ProgressCallback<'_>| (endings[index], index);
            let won = first_that_decides(endings.len(), workers, &go_on, &solve);
            assert_eq!(won, winner, "{endings:?} on {workers} threads");
        }
    }
}

#[test]
fn one_that_converges_late_still_wins_over_the_next() {
    let (second_is_done, wait) = mpsc::channel();
    let wait = Mutex::new(wait);
    let won = first_that_decides(2, 2, &go_on, &|index, _| {
        if index == 0 {
            wait.lock().unwrap().recv().unwrap();
        } else {
            second_is_done.send(()).unwrap();
        }
        (StartOutcome::Decided, index)
    });
    assert_eq!(won, 0);
}

#[test]
fn those_behind_the_winner_are_stopped() {
    let (second_has_begun, wait) = mpsc::channel();
    let wait = Mutex::new(wait);
    let won = first_that_decides(2, 2, &go_on, &|index, watched| {
        if index == 0 {
            wait.lock().unwrap().recv().unwrap();
            return (StartOutcome::Decided, index);
        }
        second_has_begun.send(()).unwrap();
        (until_stopped(watched), index)
    });
    assert_eq!(won, 0);
}

#[test]
fn on_one_thread_none_is_begun_after_the_winner() {
    let begun = AtomicUsize::new(0);
    first_that_decides(3, 1, &go_on, &|index, _| {
        begun.fetch_add(1, Ordering::SeqCst);
        (if index == 1 { StartOutcome::Decided } else { StartOutcome::Failed }, ())
    });
    assert_eq!(begun.into_inner(), 2);
}

#[test]
fn an_interrupt_ends_the_race_even_when_those_behind_have_failed() {
    for workers in 1..4 {
        let later_have_failed = AtomicUsize::new(0);
        // Simulates Ctrl-C when only the first candidate remains, if there are threads for others.
        let interrupt = |_: &Progress| {
            let wait = workers > 1 && later_have_failed.load(Ordering::SeqCst) < 2;
            if wait { ControlFlow::Continue(()) } else { ControlFlow::Break(()) }
        };
        let first = first_that_decides(3, workers, &interrupt, &|index, watched| {
            if index == 0 {
                return (until_stopped(watched), index);
            }
            later_have_failed.fetch_add(1, Ordering::SeqCst);
            (StartOutcome::Failed, index)
        });
        assert_eq!(first, 0, "on {workers} threads");
    }
}

fn shipped(robot: &str, motion: &str) -> (Robot, Motion) {
    let robot = Robot::from_toml("robot.toml", robot).unwrap();
    let motion = Motion::from_toml("motion.toml", motion, &robot).unwrap();
    (robot, motion)
}

#[test]
fn a_plan_is_the_same_however_many_threads_search() {
    let (robot, motion) = shipped(
        include_str!("../../../../shipped/robots/agilebot.toml"),
        include_str!("../../../../shipped/motions/stand.toml"),
    );
    let options = Options::default();
    let one = optimise_solution(&robot, &motion, &options, &mut go_on);
    assert_eq!(one.plan.solve.status, Status::Converged);
    for workers in [2, 3, 5, 3] {
        let search = Search::new(&robot, &motion, &options);
        assert!(search.candidates() > 2, "the motion has several starts");
        let work = || search.work(&mut go_on);
        thread::scope(|scope| {
            for _ in 1..workers {
                scope.spawn(work);
            }
            work();
        });
        assert_eq!(search.finish(), one, "on {workers} threads");
    }
}

#[test]
#[ignore = "minutes: cargo xtask nightly --only long"]
fn a_motion_that_fails_from_its_first_start_is_found_from_another() {
    let (robot, motion) = shipped(
        include_str!("../../../../shipped/robots/agilebot.toml"),
        include_str!("../../../../shipped/motions/flying_trot.toml"),
    );
    let options = Options { seed: 1, ..Options::default() };
    let candidates = candidates(&robot, &motion, &options);
    let first = optimise(&robot, &motion, &candidates[0], &mut go_on);
    assert_ne!(first.solve.status, Status::Converged);
    let plan = optimise(&robot, &motion, &options, &mut go_on);
    assert_eq!(plan.solve.status, Status::Converged, "{:?}", plan.solve);
}
