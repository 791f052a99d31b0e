//! Many motions planned at once.

use crate::error::refused;
use crate::motion::Motion;
use crate::plan::{Plan, not_consistent, options};
use crate::watch::watched;
use pyo3::IntoPyObjectExt;
use pyo3::prelude::*;
use rollwalk_planner::{Batch, BatchPlan};
use std::num::{NonZeroU32, NonZeroUsize};
use std::thread;
use std::time::Instant;

/// Progress of many plans, passed to callbacks.
#[pyclass(frozen, get_all, module = "rollwalk")]
pub struct BatchProgress {
    /// Number of motions that are planned.
    done: usize,
    /// Number of motions.
    total: usize,
    /// Plans per second and core so far.
    plans_per_s_and_core: f64,
}

#[pymethods]
impl BatchProgress {
    fn __repr__(&self) -> String {
        let Self { done, total, plans_per_s_and_core: rate } = self;
        format!("<BatchProgress {done} of {total}, {rate:.2} a second and core>")
    }
}

/// Plan many motions on all cores.
///
/// Returns a list in the order of `motions`. A motion without a consistent plan has the exception of `plan` in place of a plan.
/// The plans depend neither on `threads` nor on the other motions.
///
/// :param motions: motions to plan, also of different robots.
/// :param start: plan from which all motions are planned, as by `Plan.replan`; from scratch if it is `None`.
/// :param seed: seed of the random numbers in the start.
/// :param iterations: maximum number of iterations from each start.
/// :param samples_fixed: keep the number of samples of the motion files, even if plans are then not consistent as played.
/// :param threads: number of threads; the number of cores if it is `None`.
/// :param progress: called with a `BatchProgress`, at most ten times a second. An exception of the callback ends the work.
/// :raises KeyboardInterrupt: Ctrl-C was pressed; takes effect within an iteration.
#[pyfunction]
#[pyo3(signature = (
    motions, *, start = None, seed = 0, iterations = None, samples_fixed = false, threads = None, progress = None
))]
pub fn plan_many(
    py: Python<'_>,
    motions: Vec<Py<Motion>>,
    start: Option<&Bound<'_, Plan>>,
    seed: u64,
    iterations: Option<NonZeroU32>,
    samples_fixed: bool,
    threads: Option<NonZeroUsize>,
    progress: Option<Py<PyAny>>,
) -> PyResult<Vec<Py<PyAny>>> {
    let requests: Vec<_> = motions.iter().map(|motion| motion.get()).collect();
    let requests: Vec<_> = requests.iter().map(|of| (&*of.robot, &of.inner)).collect();
    let total = requests.len();
    let cores = threads.or_else(|| thread::available_parallelism().ok());
    let threads = cores.map_or(1, NonZeroUsize::get).min(total).max(1);
    let from = start.map(|plan| &plan.get().inner);
    let batch = Batch::new(requests, from, &options(seed, iterations, samples_fixed));
    let began = Instant::now();
    watched(py, progress.as_ref(), |watch| {
        let state = || {
            let done = batch.done();
            let spent_s = began.elapsed().as_secs_f64() * threads as f64;
            BatchProgress { done, total, plans_per_s_and_core: done as f64 / spent_s }
        };
        let work = || batch.work(&mut |_| watch.at(state()));
        thread::scope(|scope| {
            for _ in 1..threads {
                scope.spawn(work);
            }
            work();
        });
        // The callback's last state is complete, and a stop makes no difference any more.
        let _ = watch.at(state());
    })?;
    let result = |planned| match planned {
        Some(Ok(BatchPlan { plan, holds: true })) => Plan::of(plan).into_py_any(py),
        Some(Ok(BatchPlan { plan, .. })) => not_consistent(py, &[&plan]).into_py_any(py),
        Some(Err(error)) => refused(error).into_py_any(py),
        None => Err(refused("a thread ended without a plan")),
    };
    batch.finish().into_iter().map(result).collect()
}
