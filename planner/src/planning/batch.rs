//! Batch of motions, planned on several threads of the caller.
//!
//! Every motion is planned on its own: from scratch, or from one plan that is the same for all. Plans therefore depend neither on
//! the number of threads nor on their timing. A thread keeps the structures of its solves, which fit all motions that differ
//! only in goals, durations, limits and dimensions.

use super::neighbour::ReplanError;
use super::replan::replan;
use super::request::Options;
use super::search::Search;
use super::structures::Structures;
use crate::motion::Motion;
use crate::plan::{Plan, Status};
use crate::report::Report;
use crate::solve::Progress;
use rollwalk_robot::Robot;
use std::ops::ControlFlow;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Mutex, PoisonError};

/// Motions that are planned together.
///
/// ```
/// # use rollwalk_planner::{Batch, BatchPlan, Options, ReplanError, motion::Motion};
/// # use rollwalk_robot::Robot;
/// fn on_two_threads(
///     robot: &Robot,
///     motions: &[Motion],
/// ) -> Vec<Option<Result<BatchPlan, ReplanError>>> {
///     let requests = motions.iter().map(|motion| (robot, motion)).collect();
///     let batch = Batch::new(requests, None, &Options::default());
///     let work = || batch.work(&mut |_| std::ops::ControlFlow::Continue(()));
///     std::thread::scope(|scope| {
///         scope.spawn(work);
///         work();
///     });
///     batch.finish()
/// }
/// ```
pub struct Batch<'a> {
    requests: Vec<(&'a Robot, &'a Motion)>,
    /// Plan from which all motions are planned; `None` from scratch.
    from: Option<&'a Plan>,
    options: Options,
    /// Index of the first motion that no thread has begun.
    next: AtomicUsize,
    done: AtomicUsize,
    plans: Mutex<Vec<Option<Result<BatchPlan, ReplanError>>>>,
}

/// Plan of a batch.
#[derive(Clone, Debug, PartialEq)]
pub struct BatchPlan {
    /// Plan, which may not have converged.
    pub plan: Plan,
    /// True if the plan is solved and passes the checks as played.
    pub holds: bool,
}

impl<'a> Batch<'a> {
    /// Creates a batch. [`Batch::work`] plans it.
    pub fn new(
        requests: Vec<(&'a Robot, &'a Motion)>,
        from: Option<&'a Plan>,
        options: &Options,
    ) -> Self {
        let plans = Mutex::new(requests.iter().map(|_| None).collect());
        let [next, done] = [0, 0].map(AtomicUsize::new);
        Self { requests, from, options: options.clone(), next, done, plans }
    }

    /// Number of motions planned so far.
    pub fn done(&self) -> usize {
        self.done.load(Ordering::Relaxed)
    }

    /// Plans motions until no thread has another one to begin. Call this on as many threads as there are cores. `progress` is
    /// called after every iteration of this thread; a break ends this thread's work, and its motion has no plan.
    pub fn work(&self, progress: &mut dyn FnMut(&Progress) -> ControlFlow<()>) {
        let options = Options { structures: Structures::default(), ..self.options.clone() };
        while let Some((index, robot, motion)) = self.begin() {
            let plan = match self.from {
                Some(from) => replan(from, robot, motion, &options, progress),
                None => {
                    let search = Search::new(robot, motion, &options);
                    search.work(progress);
                    Ok(search.finish().plan)
                }
            };
            if plan.as_ref().is_ok_and(|plan| plan.solve.status == Status::Interrupted) {
                return;
            }
            let checked = plan.map(|plan| BatchPlan {
                holds: plan.solve.status.is_solved() && Report::new(&plan).judgement.is_good(),
                plan,
            });
            self.plans.lock().unwrap_or_else(PoisonError::into_inner)[index] = Some(checked);
            self.done.fetch_add(1, Ordering::Relaxed);
        }
    }

    /// Next motion that no thread has begun, with its index.
    fn begin(&self) -> Option<(usize, &'a Robot, &'a Motion)> {
        let index = self.next.fetch_add(1, Ordering::Relaxed);
        let &(robot, motion) = self.requests.get(index)?;
        Some((index, robot, motion))
    }

    /// Returns the plans in the order of the requests, `None` for those that a break prevented. The error of a motion states why
    /// it cannot begin at the given plan.
    pub fn finish(self) -> Vec<Option<Result<BatchPlan, ReplanError>>> {
        self.plans.into_inner().unwrap_or_else(PoisonError::into_inner)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::optimise;
    use std::{fs, thread};

    fn on(_: &Progress) -> ControlFlow<()> {
        ControlFlow::Continue(())
    }

    fn read(path: &str) -> String {
        fs::read_to_string(format!("{}/../shipped/{path}", env!("CARGO_MANIFEST_DIR"))).unwrap()
    }

    /// Car and its motions to several goals.
    fn motions() -> (Robot, Vec<Motion>) {
        let robot = Robot::from_toml("car.toml", &read("robots/car.toml")).unwrap();
        let drive = Motion::from_toml("drive.toml", &read("motions/car_drive.toml"), &robot);
        let to = |forward_m: f64| {
            let mut motion = drive.clone().unwrap();
            motion.goal.forward_m = Some(forward_m);
            motion
        };
        let motions = [0.5, 0.48, 0.46, 0.44].map(to).into();
        (robot, motions)
    }

    #[test]
    fn plans_are_those_of_each_motion_alone_on_any_number_of_threads() {
        let (robot, motions) = motions();
        let options = Options::default();
        let first = optimise(&robot, &motions[0], &options, &mut on);
        for from in [None, Some(&first)] {
            let alone = |motion: &Motion| match from {
                Some(from) => replan(from, &robot, motion, &options, &mut on).unwrap(),
                None => optimise(&robot, motion, &options, &mut on),
            };
            let expected: Vec<Plan> = motions.iter().map(alone).collect();
            for threads in [1, 3] {
                let requests = motions.iter().map(|motion| (&robot, motion)).collect();
                let batch = Batch::new(requests, from, &options);
                thread::scope(|scope| {
                    for _ in 0..threads {
                        scope.spawn(|| batch.work(&mut on));
                    }
                });
                assert_eq!(batch.done(), motions.len());
                let plans = batch.finish().into_iter().map(|of| of.unwrap().unwrap());
                let plans: Vec<Plan> =
                    plans.inspect(|of| assert!(of.holds)).map(|of| of.plan).collect();
                assert!(plans == expected, "{threads} threads");
            }
        }
    }

    #[test]
    fn a_break_leaves_the_rest_without_plans_and_other_robots_are_refused() {
        let (robot, motions) = motions();
        let requests = || motions.iter().map(|motion| (&robot, motion)).collect();
        let batch = Batch::new(requests(), None, &Options::default());
        batch.work(&mut |_| {
            if batch.done() < 2 { ControlFlow::Continue(()) } else { ControlFlow::Break(()) }
        });
        let planned: Vec<bool> = batch.finish().iter().map(Option::is_some).collect();
        assert_eq!(planned, [true, true, false, false]);

        let mut other = robot.clone();
        other.end_effectors[0].name = "another".to_owned();
        let first = optimise(&robot, &motions[0], &Options::default(), &mut on);
        let batch = Batch::new(vec![(&other, &motions[0])], Some(&first), &Options::default());
        batch.work(&mut on);
        assert!(matches!(batch.finish()[..], [Some(Err(ReplanError::OtherStructure { .. }))]));
    }
}
