//! Building of motion libraries.

use crate::documents::Source;
use crate::error::refused;
use crate::plan::{Progress, not_consistent, optimise};
use crate::watch::{Watch, watched};
use pyo3::prelude::*;
use rollwalk_planner::building::{Contents, Missing, Solver, TransitionPlan};
use rollwalk_planner::motion::Motion;
use rollwalk_planner::plan::{Plan, Status};
use rollwalk_planner::{self as planner, Options, TransitionError, optimise_transition};
use rollwalk_robot::Robot;
use std::borrow::Cow;
use std::num::NonZeroUsize;
use std::path::PathBuf;

/// Plan every motion and transition of a library file, and pack them into a motion library.
///
/// The bytes are those of `rollwalk library build` on the same machine.
///
/// :param path: path of the library file (TOML). The file names the robot, the motions and their codes.
/// :param threads: number of threads that try starts of a motion; the number of cores if it is `None`.
/// :param progress: called with a `Progress`, at most ten times a second. An exception of the callback ends the work.
/// :returns: the bytes of the library; write them to a `.rwl` file for `rollwalk flash`.
/// :raises RollwalkError: all mistakes in one of the files, or a motion that the library format cannot represent.
/// :raises OSError: a file cannot be read.
/// :raises NotConsistent: plans are not consistent; the exception contains the first.
/// :raises KeyboardInterrupt: Ctrl-C was pressed; takes effect within an iteration.
#[pyfunction]
#[pyo3(signature = (path, *, threads = None, progress = None))]
pub fn build_library(
    py: Python<'_>,
    path: PathBuf,
    threads: Option<NonZeroUsize>,
    progress: Option<Py<PyAny>>,
) -> PyResult<Cow<'static, [u8]>> {
    let contents = Source::Disk.library(&path)?;
    let built = watched(py, progress.as_ref(), |watch| {
        build(&contents, &mut ProgressSolver { threads, watch })
    })?;
    match built {
        Built::Library(bytes) => Ok(bytes.into()),
        Built::Failed(plans) => Err(not_consistent(py, &plans.iter().collect::<Vec<_>>())),
        Built::Refused(reason) => Err(refused(reason)),
    }
}

/// Result of a build.
enum Built {
    Library(Vec<u8>),
    /// Plans that are not consistent.
    Failed(Vec<Plan>),
    /// Reason why the library cannot be packed.
    Refused(String),
}

fn build(contents: &Contents, solver: &mut ProgressSolver<'_>) -> Built {
    let wanted = contents.request();
    // The caller that stops the build raises another exception.
    let stopped = || Built::Refused("stopped".to_owned());
    let Some(motions) = wanted.motions(solver) else { return stopped() };
    let transitions = match wanted.transitions(&motions, solver) {
        Ok(Some(transitions)) => transitions,
        Ok(None) => return stopped(),
        Err(error) => return Built::Refused(error.to_string()),
    };
    let all = motions.iter().chain(transitions.iter().map(|of| &of.plan));
    let failed: Vec<Plan> =
        all.filter(|plan| plan.solve.status != Status::Converged).cloned().collect();
    if !failed.is_empty() {
        return Built::Failed(failed);
    }
    let joined =
        transitions.iter().map(|of| TransitionPlan { from: of.from, to: of.to, plan: &of.plan });
    match wanted.pack(&motions, joined) {
        Ok(built) => Built::Library(built.bytes),
        Err(error) => Built::Refused(error.to_string()),
    }
}

/// Solver that reports its progress, and ends when the caller requests it.
struct ProgressSolver<'w> {
    threads: Option<NonZeroUsize>,
    watch: &'w Watch<Progress>,
}

impl Solver for ProgressSolver<'_> {
    fn motion(&mut self, robot: &Robot, motion: &Motion, options: &Options) -> Option<Plan> {
        let plan = optimise(robot, motion, options, self.threads, self.watch);
        (!self.watch.is_stopped()).then_some(plan)
    }

    fn transition(
        &mut self,
        motion: &Motion,
        from: &Plan,
        to: &Plan,
        options: &Options,
    ) -> Result<Option<Plan>, TransitionError> {
        let see = &mut |state: &planner::Progress| self.watch.at(Progress::of(&motion.name, state));
        let plan = optimise_transition(motion, from, to, options, see)?;
        Ok((!self.watch.is_stopped()).then_some(plan))
    }

    fn plan_given(&mut self, _: &Motion) {}

    fn left_out(&mut self, _: &Motion, _: Missing<'_>) {}
}
