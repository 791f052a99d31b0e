//! Races of solves that end as, and when, the test says, and of real ones.

use super::*;
use crate::inputs::Source;
use rollwalk_planner::families::Family;
use rollwalk_planner::plan::Status;
use std::path::Path;
use std::sync::mpsc;

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

/// Iterates until somebody stops it.
fn until_stopped(watched: &mut Watched) -> Ending {
    while watched(&STATE).is_continue() {
        thread::yield_now();
    }
    Ending::Decided
}

#[test]
fn the_first_in_order_wins_with_any_number_of_threads() {
    use Ending::{Decided, Failed, Hopeless};
    for (endings, winner) in [
        (&[Decided, Decided, Decided][..], 0),
        (&[Failed, Decided, Decided], 1),
        (&[Failed, Failed, Hopeless, Decided], 3),
        (&[Failed, Failed, Failed], 0),
        (&[Decided], 0),
        // One start that sees no way is not enough, two are, whatever comes after them: the first tells why.
        (&[Hopeless, Decided, Decided], 1),
        (&[Hopeless, Failed, Decided], 2),
        (&[Hopeless, Hopeless, Decided], 0),
        (&[Hopeless], 0),
    ] {
        for workers in 1..6 {
            let solve = |index: usize, _: &mut Watched| (endings[index], index);
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
        (Ending::Decided, index)
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
            return (Ending::Decided, index);
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
        (if index == 1 { Ending::Decided } else { Ending::Failed }, ())
    });
    assert_eq!(begun.into_inner(), 2);
}

#[test]
fn an_interrupt_ends_the_race_even_when_those_behind_have_failed() {
    for workers in 1..4 {
        let later_have_failed = AtomicUsize::new(0);
        // Presses Ctrl-C when only the first candidate is left, as far as there are threads for others.
        let interrupt = |_: &Progress| {
            let wait = workers > 1 && later_have_failed.load(Ordering::SeqCst) < 2;
            if wait { ControlFlow::Continue(()) } else { ControlFlow::Break(()) }
        };
        let first = first_that_decides(3, workers, &interrupt, &|index, watched| {
            if index == 0 {
                return (until_stopped(watched), index);
            }
            later_have_failed.fetch_add(1, Ordering::SeqCst);
            (Ending::Failed, index)
        });
        assert_eq!(first, 0, "on {workers} threads");
    }
}

#[test]
fn a_plan_is_the_same_however_many_threads_race() {
    let (robot, motion) = Source::Shipped.motion(Path::new("motions/stand.toml")).unwrap();
    let candidates = start::candidates(&robot, &motion, &Options::default());
    assert!(candidates.len() > 2, "the motion has several starts");
    let plan = |workers| {
        first_that_decides(candidates.len(), workers, &go_on, &|index, watched| {
            let plan = optimise(&robot, &motion, &candidates[index], watched);
            (plan.solve.ending(), plan)
        })
    };
    let one = plan(1);
    assert_eq!(one.solve.status, Status::Converged);
    assert_eq!(one, optimise_any(&robot, &motion, &Options::default(), &go_on));
    for workers in [2, 3, 5, 3] {
        assert_eq!(plan(workers), one, "on {workers} threads");
    }
}
