//! Planning of motions, and plans.

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

/// Progress of a solve, passed to callbacks.
#[pyclass(frozen, get_all, module = "rollwalk")]
pub struct Progress {
    /// Name of the motion that is planned.
    motion: String,
    /// Number of iterations so far, from the current start.
    iteration: usize,
    /// Worst constraint residual as a fraction of its tolerance: 0.2 is accepted.
    worst_level: f64,
    /// Name of the constraint with the worst residual.
    worst_constraint: &'static str,
    /// Weighted sum of costs and constraint violations.
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

/// Diagnosis of an infeasible request: the constraints that contradict each other.
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
    /// Contradicting constraints: those of the requested motion first, then the limits that oppose them.
    #[getter]
    fn culprits(&self) -> Vec<Culprit> {
        self.culprits.iter().map(Culprit::of).collect()
    }

    fn __str__(&self) -> &str {
        &self.words
    }
}

/// Constraint that takes part in a contradiction.
#[pyclass(frozen, module = "rollwalk")]
pub struct Culprit {
    /// Name of the constraint.
    #[pyo3(get)]
    constraint: &'static str,
    /// End effector, joint or direction of the constraint; `None` for the whole robot.
    #[pyo3(get)]
    subject: Option<String>,
    /// First and last time at which the constraint contributes to the violation, s.
    #[pyo3(get)]
    time_s: (f64, f64),
    /// Largest residual, in `unit`.
    #[pyo3(get)]
    worst: f64,
    /// Unit of `worst`, `given` and `would_do`; a `duration_s` is always in s.
    #[pyo3(get)]
    unit: String,
    /// Fraction of the total violation, 0 to 1.
    #[pyo3(get)]
    share: f64,
    /// Field of the motion or robot file that sets the constraint, if a single value sets it.
    #[pyo3(get)]
    field: Option<String>,
    /// Value of that field.
    #[pyo3(get)]
    given: Option<f64>,
    /// Feasible value of the field: a plan was found with it, everything else unchanged.
    #[pyo3(get)]
    would_do: Option<f64>,
    /// Advice: the change that would make the request feasible.
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

/// A planned motion, with its robot and its goal.
#[pyclass(frozen, module = "rollwalk")]
pub struct Plan {
    /// Plan in the planner's form.
    pub inner: planned::Plan,
}

impl Plan {
    /// Wraps a validated plan.
    pub fn of(plan: planned::Plan) -> Self {
        Self { inner: plan }
    }

    /// Wraps a plan that is consistent; raises `NotConsistent` for another one.
    fn good(py: Python<'_>, plan: planned::Plan) -> PyResult<Self> {
        match py.detach(|| planner::report::Report::new(&plan).judgement.is_good()) {
            true => Ok(Self::of(plan)),
            false => Err(not_consistent(py, &[&plan])),
        }
    }
}

#[pymethods]
impl Plan {
    /// Read a plan (JSON) of this package or of `rollwalk plan`, consistent or not.
    ///
    /// :param path: path of the file, such as `walk.plan.json`.
    /// :raises RollwalkError: the file is not a plan of this version, or contains an invalid value.
    /// :raises OSError: the file cannot be read.
    #[staticmethod]
    fn load(path: PathBuf) -> PyResult<Self> {
        Source::Disk.plan(&path).map(Self::of)
    }

    /// Write the plan (JSON), with the same bytes as `rollwalk plan`. All commands that take a plan can read the file.
    ///
    /// :param path: path of the file. An existing file is replaced.
    /// :raises OSError: the file cannot be written.
    fn save(&self, path: PathBuf) -> PyResult<()> {
        let text = self.inner.to_json();
        fs::write(&path, text).map_err(|error| refused_by_system("cannot write", &path, &error))
    }

    /// Plan another motion, starting from this plan.
    ///
    /// The other motion may have a different goal, duration or footfalls, or a robot with different dimensions. This takes a
    /// few iterations, and `plan` takes many.
    ///
    /// :param motion: motion to plan. It must have the joints, end effectors and kind of ends of this plan.
    /// :param iterations: maximum number of iterations from each start.
    /// :param samples_fixed: keep the number of samples of the motion file, even if the plan is then not consistent as played.
    /// :param progress: called with a `Progress`, at most ten times a second. An exception of the callback ends the solve.
    /// :raises RollwalkError: the motion is too different.
    /// :raises Infeasible: the request is infeasible; the exception contains a diagnosis and the best plan found.
    /// :raises NotConsistent: the plan that was found is not consistent.
    /// :raises KeyboardInterrupt: Ctrl-C was pressed; takes effect within an iteration.
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

    /// Robot of the plan.
    #[getter]
    fn robot(&self) -> Robot {
        Robot::of(self.inner.robot.clone())
    }

    /// Duration, s; the period of a periodic motion.
    #[getter]
    fn duration_s(&self) -> f64 {
        self.inner.motion.duration_s
    }

    /// Status of the solve: `converged`, `fails as played`, `infeasible`, `stalled`, `iteration limit reached`, `interrupted`.
    #[getter]
    fn status(&self) -> String {
        self.inner.solve.status.to_string()
    }

    /// Number of iterations of the solve.
    #[getter]
    fn iterations(&self) -> usize {
        self.inner.solve.iterations
    }

    /// Weighted costs of the plan.
    #[getter]
    fn energy(&self) -> f64 {
        self.inner.solve.energy
    }

    /// Displacement by the motion: forward, m, left, m, and turn to the left, rad; for one period of a periodic motion.
    #[getter]
    fn reached(&self) -> (f64, f64, f64) {
        self.inner.reached().into()
    }

    /// Recompute every residual from the values of the plan alone, as `rollwalk report` does.
    fn report(&self, py: Python<'_>) -> Report {
        py.detach(|| Report::of(&self.inner))
    }

    /// Sample the motion at any rate, with the values of `rollwalk export`.
    ///
    /// :param rate_hz: rows per second, above 0 and up to 10,000.
    /// :raises RollwalkError: the rate is out of range.
    #[pyo3(signature = (rate_hz = 60.0))]
    fn sample(&self, py: Python<'_>, rate_hz: f64) -> PyResult<Samples> {
        Samples::of(py, &self.inner, rate_hz)
    }

    fn __repr__(&self) -> String {
        let planned::Plan { motion, robot, solve, .. } = &self.inner;
        format!("<Plan {} of {}: {}>", motion.name, robot.name, solve.status)
    }
}

/// Plan a motion, with the same bytes as `rollwalk plan` on the same machine.
///
/// Other threads of the program continue to run.
///
/// :param motion: motion to plan.
/// :param seed: seed of the random numbers in the start; the same seed gives the same plan.
/// :param iterations: maximum number of iterations from each start.
/// :param samples_fixed: keep the number of samples of the motion file, even if the plan is then not consistent as played.
/// :param threads: number of threads that try starts; the number of cores if it is `None`. The plan does not depend on it.
/// :param progress: called with a `Progress`, at most ten times a second. An exception of the callback ends the solve.
/// :raises Infeasible: the request is infeasible; the exception contains a diagnosis and the best plan found.
/// :raises NotConsistent: the plan that was found is not consistent.
/// :raises KeyboardInterrupt: Ctrl-C was pressed; takes effect within an iteration.
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

/// Exception for plans that are not consistent, with the message of the command line and the first of the plans.
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

/// Options of a solve.
pub fn options(seed: u64, iterations: Option<NonZeroU32>, samples_fixed: bool) -> Options {
    let mut options = Options { seed, refine: !samples_fixed, ..Options::default() };
    if let Some(most) = iterations {
        options.settings.iterations = most.get() as usize;
    }
    options
}

/// Optimises a motion with its free times, or with the given ones from its candidate starts on several threads.
pub fn optimise(
    robot: &robot::Robot,
    motion: &planner::motion::Motion,
    options: &Options,
    threads: Option<NonZeroUsize>,
    watch: &Watch<Progress>,
) -> planned::Plan {
    let progress = &mut |state: &_| watch.at(Progress::of(&motion.name, state));
    if let Some(chosen) = planner::timing::choose(robot, motion, options, progress) {
        return chosen.plan;
    }
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
