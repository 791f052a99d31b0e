//! Plans, and how they are found.

use crate::documents::Source;
use crate::error::{refused, refused_by_system};
use crate::motion::Motion;
use crate::report::Report;
use crate::robot::Robot;
use crate::samples::Samples;
use crate::watch::{Watch, watched};
use pyo3::prelude::*;
use pyo3::{IntoPyObjectExt, import_exception};
use rollwalk_planner::plan as planned;
use rollwalk_planner::{self as planner, Options, Search};
use rollwalk_robot as robot;
use std::fs;
use std::num::{NonZeroU32, NonZeroUsize};
use std::path::PathBuf;
use std::thread;

import_exception!(rollwalk._errors, NotConsistent);
import_exception!(rollwalk._errors, Infeasible);

/// Progress of a solve, as callbacks get it.
#[pyclass(frozen, get_all, module = "rollwalk")]
pub struct Progress {
    /// Name of the motion that is planned.
    motion: String,
    /// Iterations so far, from the present start.
    iteration: usize,
    /// Worst constraint residual as a fraction of its tolerance: 0.2 is accepted.
    worst_level: f64,
    /// Name of that constraint.
    worst_constraint: &'static str,
    /// Costs and violations, as the optimiser weighs them.
    energy: f64,
}

#[pymethods]
impl Progress {
    fn __repr__(&self) -> String {
        let Self { motion, iteration, worst_level, worst_constraint, .. } = self;
        format!(
            "<Progress {motion}: iteration {iteration}, {worst_constraint} at {worst_level:.2}>"
        )
    }
}

impl Progress {
    /// Progress of an iteration of a motion's solve.
    pub fn of(motion: &str, state: &planner::Progress) -> Self {
        Self {
            motion: motion.to_owned(),
            iteration: state.iteration,
            worst_level: state.worst_level,
            worst_constraint: state.worst_constraint.name(),
            energy: state.energy,
        }
    }
}

/// Diagnosis of a request that cannot be met: the constraints that contradict each other.
#[pyclass(frozen, module = "rollwalk")]
pub struct Diagnosis {
    /// Strength of the evidence: `contradiction`, `far_off` or `stuck`.
    #[pyo3(get)]
    verdict: &'static str,
    culprits: Vec<planned::Culprit>,
    words: String,
}

impl Diagnosis {
    /// Converts the diagnosis of a plan.
    pub fn of(diagnosis: &planned::Diagnosis) -> Self {
        Self {
            verdict: match diagnosis.verdict {
                planned::Verdict::Contradiction => "contradiction",
                planned::Verdict::FarOff => "far_off",
                planned::Verdict::Stuck => "stuck",
            },
            culprits: diagnosis.culprits.clone(),
            words: diagnosis.to_string(),
        }
    }
}

#[pymethods]
impl Diagnosis {
    /// The constraints: what the motion asks for first, then what stands against it.
    #[getter]
    fn culprits(&self) -> Vec<Culprit> {
        self.culprits.iter().map(Culprit::of).collect()
    }

    fn __str__(&self) -> &str {
        &self.words
    }
}

/// A constraint that takes part in a contradiction.
#[pyclass(frozen, module = "rollwalk")]
pub struct Culprit {
    /// Name of the constraint.
    #[pyo3(get)]
    constraint: &'static str,
    /// End effector, joint or direction that it is about; `None` for the whole robot.
    #[pyo3(get)]
    subject: Option<String>,
    /// First and last time at which the constraint contributes to the violation, s.
    #[pyo3(get)]
    time_s: (f64, f64),
    /// Largest residual, in `unit`.
    #[pyo3(get)]
    worst: f64,
    /// Unit of `worst`, `given` and `would_do`; a `duration_s` is in s whatever this says.
    #[pyo3(get)]
    unit: String,
    /// Share of the violation, 0 to 1.
    #[pyo3(get)]
    share: f64,
    /// Field of the motion or robot file that sets the constraint, where it is one number.
    #[pyo3(get)]
    field: Option<String>,
    /// Number in that field.
    #[pyo3(get)]
    given: Option<f64>,
    /// A number with which a plan was found, all else as it is.
    #[pyo3(get)]
    would_do: Option<f64>,
    /// Advice: the change that would help.
    #[pyo3(get)]
    advice: String,
    words: String,
}

impl Culprit {
    fn of(culprit: &planned::Culprit) -> Self {
        let planned::Culprit { subject, worst, unit, share, field, given, would_do, .. } = culprit;
        Self {
            constraint: culprit.constraint.name(),
            subject: subject.clone(),
            time_s: culprit.time_s.into(),
            worst: *worst,
            unit: unit.clone(),
            share: *share,
            field: field.clone(),
            given: *given,
            would_do: *would_do,
            advice: culprit.advice.clone(),
            words: culprit.to_string(),
        }
    }
}

#[pymethods]
impl Culprit {
    fn __str__(&self) -> &str {
        &self.words
    }
}

/// A planned motion with the robot and the goal that it was planned for.
#[pyclass(frozen, module = "rollwalk")]
pub struct Plan {
    /// The plan.
    pub inner: planned::Plan,
}

impl Plan {
    /// Wraps a validated plan.
    pub fn of(plan: planned::Plan) -> Self {
        Self { inner: plan }
    }

    /// A plan that is consistent.
    fn good(py: Python<'_>, plan: planned::Plan) -> PyResult<Self> {
        match py.detach(|| planner::report::Report::new(&plan).judgement.is_good()) {
            true => Ok(Self::of(plan)),
            false => Err(not_consistent(py, &[&plan])),
        }
    }
}

#[pymethods]
impl Plan {
    /// Read a plan (JSON), also one that `rollwalk plan` wrote, whether it is consistent or not.
    ///
    /// :param path: the file, such as `walk.plan.json`.
    /// :raises RollwalkError: it is no plan of this version, or has a value that no plan can have.
    /// :raises OSError: it cannot be read.
    #[staticmethod]
    fn load(path: PathBuf) -> PyResult<Self> {
        Source::Disk.plan(&path).map(Self::of)
    }

    /// Write the plan (JSON), the same bytes as `rollwalk plan` writes. All commands that take a plan read it.
    ///
    /// :param path: the file. What was there is replaced.
    /// :raises OSError: it cannot be written.
    fn save(&self, path: PathBuf) -> PyResult<()> {
        let text = self.inner.to_json();
        fs::write(&path, text).map_err(|error| refused_by_system("cannot write", &path, &error))
    }

    /// Plan another motion from this plan: the same one with another goal, duration or footfalls, or of a robot with other
    /// measures. That takes a few iterations where `plan` takes many.
    ///
    /// :param motion: what to plan. It has the joints, end effectors and kind of ends of this plan.
    /// :param iterations: at most so many, from each start.
    /// :param samples_fixed: keep the samples of the motion file, also if the plan then is not consistent as it is played.
    /// :param progress: called with a `Progress`, at most ten times a second. What it raises ends the solve.
    /// :raises RollwalkError: the motion is too different.
    /// :raises Infeasible: the request cannot be met, with a diagnosis and the best that was found.
    /// :raises NotConsistent: the plan that was found is not consistent.
    /// :raises KeyboardInterrupt: Ctrl-C, within an iteration.
    #[pyo3(signature = (motion, *, iterations = None, samples_fixed = false, progress = None))]
    fn replan(
        &self,
        py: Python<'_>,
        motion: &Bound<'_, Motion>,
        iterations: Option<NonZeroU32>,
        samples_fixed: bool,
        progress: Option<Py<PyAny>>,
    ) -> PyResult<Self> {
        let Motion { robot, inner: motion } = motion.get();
        let options = options(0, iterations, samples_fixed);
        let plan = watched(py, progress.as_ref(), |watch| {
            let see = &mut |state: &_| watch.at(Progress::of(&motion.name, state));
            planner::replan(&self.inner, robot, motion, &options, see)
        })?;
        Self::good(py, plan.map_err(refused)?)
    }

    /// Name of the motion.
    #[getter]
    fn name(&self) -> &str {
        &self.inner.motion.name
    }

    /// The robot that it is for.
    #[getter]
    fn robot(&self) -> Robot {
        Robot::of(self.inner.robot.clone())
    }

    /// Duration, s; of a motion that repeats, its period.
    #[getter]
    fn duration_s(&self) -> f64 {
        self.inner.motion.duration_s
    }

    /// Status of the solve: `converged`, `fails as played`, `infeasible`, `stalled`, `iteration limit reached`, `interrupted`.
    #[getter]
    fn status(&self) -> String {
        self.inner.solve.status.to_string()
    }

    /// Iterations of the solve.
    #[getter]
    fn iterations(&self) -> usize {
        self.inner.solve.iterations
    }

    /// Costs of the plan, as the optimiser weighs them.
    #[getter]
    fn energy(&self) -> f64 {
        self.inner.solve.energy
    }

    /// Displacement by the motion: forward, m, to the left, m, and turned to the left, rad; of its period if it repeats.
    #[getter]
    fn reached(&self) -> (f64, f64, f64) {
        self.inner.reached().into()
    }

    /// Recompute every residual of the plan from its numbers alone, as `rollwalk report` does.
    fn report(&self, py: Python<'_>) -> Report {
        py.detach(|| Report::of(&self.inner))
    }

    /// The motion at any rate, with the values of `rollwalk export`.
    ///
    /// :param rate_hz: rows per second, above 0 and up to 10,000.
    /// :raises RollwalkError: another rate.
    #[pyo3(signature = (rate_hz = 60.0))]
    fn sample(&self, py: Python<'_>, rate_hz: f64) -> PyResult<Samples> {
        Samples::of(py, &self.inner, rate_hz)
    }

    fn __repr__(&self) -> String {
        let planned::Plan { motion, robot, solve, .. } = &self.inner;
        format!("<Plan {} of {}: {}>", motion.name, robot.name, solve.status)
    }
}

/// Plan a motion, as `rollwalk plan` does: the same bytes on the same machine.
///
/// Other threads of the program run meanwhile.
///
/// :param motion: what to plan.
/// :param seed: of everything random in the start; the same seed gives the same plan.
/// :param iterations: at most so many, from each start.
/// :param samples_fixed: keep the samples of the motion file, also if the plan then is not consistent as it is played.
/// :param threads: on which starts are tried; as many as there are cores if it is `None`. The plan does not depend on it.
/// :param progress: called with a `Progress`, at most ten times a second. What it raises ends the solve.
/// :raises Infeasible: the request cannot be met, with a diagnosis and the best that was found.
/// :raises NotConsistent: the plan that was found is not consistent.
/// :raises KeyboardInterrupt: Ctrl-C, within an iteration.
#[pyfunction]
#[pyo3(signature = (motion, *, seed = 0, iterations = None, samples_fixed = false, threads = None, progress = None))]
pub fn plan(
    py: Python<'_>,
    motion: &Bound<'_, Motion>,
    seed: u64,
    iterations: Option<NonZeroU32>,
    samples_fixed: bool,
    threads: Option<NonZeroUsize>,
    progress: Option<Py<PyAny>>,
) -> PyResult<Plan> {
    let Motion { robot, inner: motion } = motion.get();
    let options = options(seed, iterations, samples_fixed);
    let plan =
        watched(py, progress.as_ref(), |watch| optimise(robot, motion, &options, threads, watch))?;
    Plan::good(py, plan)
}

/// Plans that are not consistent, in the words of the command line. The exception carries the first of them.
pub fn not_consistent(py: Python<'_>, plans: &[&planned::Plan]) -> PyErr {
    let words = |plan: &&planned::Plan| {
        let report = planner::report::Report::new(plan);
        format!("{} {}", plan.motion.name, report.words(&plan.solve))
    };
    let text = plans.iter().map(words).collect::<Vec<_>>().join("\n");
    let Some(first) = plans.first() else { return refused(text) };
    let best = Plan::of((*first).clone()).into_py_any(py);
    match (best, first.solve.diagnosis.as_ref()) {
        (Ok(best), Some(diagnosis)) => match Diagnosis::of(diagnosis).into_py_any(py) {
            Ok(diagnosis) => Infeasible::new_err((text, best, diagnosis)),
            Err(error) => error,
        },
        (Ok(best), None) => NotConsistent::new_err((text, best)),
        (Err(error), _) => error,
    }
}

fn options(seed: u64, iterations: Option<NonZeroU32>, samples_fixed: bool) -> Options {
    let mut options = Options { seed, refine: !samples_fixed, ..Options::default() };
    if let Some(most) = iterations {
        options.settings.iterations = most.get() as usize;
    }
    options
}

/// Optimises a motion from its candidate starts on several threads.
pub fn optimise(
    robot: &robot::Robot,
    motion: &planner::motion::Motion,
    options: &Options,
    threads: Option<NonZeroUsize>,
    watch: &Watch<Progress>,
) -> planned::Plan {
    let search = Search::new(robot, motion, options);
    let cores = threads.or_else(|| thread::available_parallelism().ok());
    let threads = cores.map_or(1, NonZeroUsize::get).min(search.candidates());
    let work = || search.work(&mut |state| watch.at(Progress::of(&motion.name, state)));
    thread::scope(|scope| {
        for _ in 1..threads {
            scope.spawn(work);
        }
        work();
    });
    search.finish().plan
}
