//! Long operations outside of Python's global lock, so that other threads run, with progress and Ctrl-C.
//!
//! The work has its own thread and polls between iterations for a request to stop. The calling thread waits for it, checks for
//! signals and calls back ten times a second.

use pyo3::prelude::*;
use std::ops::ControlFlow;
use std::panic::resume_unwind;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, channel};
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::thread;
use std::time::Duration;

/// Interval between checks for signals, and between calls of the callback.
const TICK: Duration = Duration::from_millis(100);

/// State shared by the work and the thread that waits for it.
pub struct Watch<P> {
    stop: AtomicBool,
    /// Latest state; `None` after it was passed to the callback.
    latest: Mutex<Option<P>>,
}

impl<P> Watch<P> {
    /// Stores the state of the work; breaks if a stop was requested.
    pub fn at(&self, state: P) -> ControlFlow<()> {
        *self.latest() = Some(state);
        if self.is_stopped() { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    }

    /// True if the work should stop.
    pub fn is_stopped(&self) -> bool {
        self.stop.load(Ordering::Relaxed)
    }

    fn latest(&self) -> MutexGuard<'_, Option<P>> {
        self.latest.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Calls the callback if there is a new state.
    fn call_back(&self, py: Python<'_>, progress: Option<&Py<PyAny>>) -> PyResult<()>
    where
        P: for<'py> IntoPyObject<'py>,
    {
        let news = self.latest().take();
        match (progress, news) {
            (Some(progress), Some(news)) => progress.call1(py, (news,)).map(drop),
            _ => Ok(()),
        }
    }
}

/// Runs `work` with progress. `progress` is called with the latest state at most ten times a second, and with the final state
/// at the end.
///
/// # Errors
/// Stops the work and returns the exception of `progress`, or `KeyboardInterrupt` after Ctrl-C.
pub fn watched<P, T>(
    py: Python<'_>,
    progress: Option<&Py<PyAny>>,
    work: impl FnOnce(&Watch<P>) -> T + Send,
) -> PyResult<T>
where
    P: Send + for<'py> IntoPyObject<'py>,
    T: Send,
{
    let watch = Watch { stop: AtomicBool::new(false), latest: Mutex::new(None) };
    let done = py.detach(|| {
        thread::scope(|scope| {
            let (sender, result) = channel();
            let watch = &watch;
            let worker = scope.spawn(move || {
                // After a stop, no receiver remains.
                let _ = sender.send(work(watch));
            });
            let waited = wait(watch, progress, &result);
            watch.stop.store(true, Ordering::Relaxed);
            if let Err(panic) = worker.join() {
                resume_unwind(panic);
            }
            waited
        })
    })?;
    watch.call_back(py, progress)?;
    Ok(done.expect("work that did not panic has a result"))
}

/// Waits for the result; returns `None` if the work ended without one.
fn wait<P, T>(
    watch: &Watch<P>,
    progress: Option<&Py<PyAny>>,
    result: &Receiver<T>,
) -> PyResult<Option<T>>
where
    P: for<'py> IntoPyObject<'py>,
{
    loop {
        match result.recv_timeout(TICK) {
            Ok(done) => return Ok(Some(done)),
            Err(RecvTimeoutError::Disconnected) => return Ok(None),
            Err(RecvTimeoutError::Timeout) => Python::attach(|py| {
                py.check_signals()?;
                watch.call_back(py, progress)
            })?,
        }
    }
}
