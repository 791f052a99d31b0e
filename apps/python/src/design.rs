//! Designs: robots of which something may change, and how their plans change with it.

use crate::arrays::{matrix, vector};
use crate::documents::{Source, shipped};
use crate::error::{refused, wrong};
use crate::plan::{Plan, Progress, not_consistent};
use crate::watch::watched;
use numpy::{PyArray1, PyArray2};
use pyo3::prelude::*;
use rollwalk_design::designed::Designed;
use rollwalk_design::goal::Quantity;
use rollwalk_design::plans::Failed;
use rollwalk_planner::sensitivity::{Curvature, Feature, Objective};
use std::collections::HashMap;
use std::path::PathBuf;

/// A robot with parameters and the motions that it is for, as a design file describes it.
#[pyclass(frozen, module = "rollwalk")]
pub struct Design {
    designed: Designed,
}

/// Parameter of a robot in a design.
#[pyclass(frozen, get_all, module = "rollwalk")]
pub struct Parameter {
    /// Name in the design file.
    name: String,
    /// Value of the robot file, in `unit`.
    value: f64,
    /// Least value, in `unit`.
    min: f64,
    /// Largest value, in `unit`.
    max: f64,
    /// `m`, `rad`, `rad/s`, `N·m`, `kg` or `s`.
    unit: &'static str,
}

#[pymethods]
impl Parameter {
    fn __repr__(&self) -> String {
        let Self { name, value, min, max, unit } = self;
        format!("<Parameter {name}: {value} {unit}, {min} to {max} {unit}>")
    }
}

/// Derivatives of a motion's optimal plan with respect to the P parameters of a design.
///
/// Objectives are those of `[goal]` in design files: `plan_cost`, `peak_joint_speed` (rad/s), `joint_torque` (root mean square,
/// N·m), `peak_joint_torque` (N·m), `power` (W), `cost_of_transport`. Features are those of `rollwalk design keep`, at each of
/// the plan's S samples: `pitch`, `tilt`, `joints` (rad), `height`, `body`, `feet` (m).
#[pyclass(frozen, get_all, module = "rollwalk")]
pub struct Gradients {
    /// Plan of the motion at these values of the parameters.
    plan: Py<Plan>,
    /// Names of the parameters, the last axis of all derivatives.
    parameter_names: Vec<String>,
    /// Values at the optimum by name of the objective, in its unit.
    objectives: HashMap<&'static str, f64>,
    /// Derivatives by name of the objective, per unit of each parameter, shape (P,). An objective that the motion does not have,
    /// such as the cost of transport of one that goes nowhere, is left out.
    gradients: HashMap<&'static str, Py<PyArray1<f64>>>,
    /// Values at the optimum by name of the feature, shape (F,): sample after sample, all numbers of each.
    features: HashMap<&'static str, Py<PyArray1<f64>>>,
    /// Derivatives ∂feature/∂parameter by name of the feature, shape (F, P).
    jacobians: HashMap<&'static str, Py<PyArray2<f64>>>,
    /// True if the derivatives are estimates with the Gauss-Newton curvature: no optimum near the plan was found at which the
    /// second derivatives are positive.
    estimated: bool,
}

/// The numbers of a motion's gradients.
#[derive(Default)]
struct Numbers {
    objectives: Vec<(Objective, f64, Vec<f64>)>,
    /// Values, and changes with each parameter.
    features: Vec<(Feature, Vec<f64>, Vec<Vec<f64>>)>,
    /// True if the derivatives are estimates.
    estimated: bool,
}

#[pymethods]
impl Design {
    /// Read a design file (TOML), the robot and the motions that it names.
    ///
    /// :param path: the file, such as `agilebot_legs.toml`.
    /// :raises RollwalkError: everything that is wrong in one of them, and parameters that do not fit the robot.
    /// :raises OSError: one of them cannot be read.
    #[staticmethod]
    fn from_file(path: PathBuf) -> PyResult<Self> {
        Ok(Self { designed: Source::Disk.design(&path)? })
    }

    /// A design that ships with Rollwalk.
    ///
    /// :param name: of its file, such as `agilebot_legs`.
    /// :raises RollwalkError: there is none of this name; the message lists all.
    #[staticmethod]
    fn shipped(name: &str) -> PyResult<Self> {
        Ok(Self { designed: Source::Shipped.design(&shipped("designs", name))? })
    }

    /// Name of the design.
    #[getter]
    fn name(&self) -> &str {
        &self.designed.file.name
    }

    /// Parameters, in the order of all derivatives.
    #[getter]
    fn parameters(&self) -> Vec<Parameter> {
        let all = self.designed.file.parameters.iter().zip(self.designed.original());
        let parameter = |(of, value): (&rollwalk_design::file::Parameter, &f64)| Parameter {
            name: of.name.clone(),
            value: *value,
            min: of.min,
            max: of.max,
            unit: of.place.kind.unit().0,
        };
        all.map(parameter).collect()
    }

    /// The robot file at some values of the parameters, comments kept.
    ///
    /// :param values: parameters by name with their values, in their units; all others have those of the robot file.
    /// :raises RollwalkError: a parameter that the design has not, or a robot that breaks a rule.
    #[pyo3(signature = (values = HashMap::new()))]
    fn robot_toml(&self, values: HashMap<String, f64>) -> PyResult<String> {
        Ok(self.designed.at(&self.values(&values)?).map_err(wrong)?.text)
    }

    /// Plan all motions of the design, and take derivatives of the optimal plans by all parameters (thesis 2.5.1).
    ///
    /// :param objectives: names of what to differentiate, see `Gradients`.
    /// :param features: names of curves to differentiate, see `Gradients`.
    /// :param values: parameters by name with their values, in their units; all others have those of the robot file.
    /// :param progress: called with a `Progress`, at most ten times a second. What it raises ends the work.
    /// :returns: the derivatives of each motion, in the order of the design file.
    /// :raises RollwalkError: a name that there is not, or a plan that has no derivatives.
    /// :raises NotConsistent: a motion that the robot cannot do.
    /// :raises KeyboardInterrupt: Ctrl-C, within an iteration.
    #[pyo3(signature = (objectives = Vec::new(), features = Vec::new(), *, values = HashMap::new(), progress = None))]
    fn gradients(
        &self,
        py: Python<'_>,
        objectives: Vec<String>,
        features: Vec<String>,
        values: HashMap<String, f64>,
        progress: Option<Py<PyAny>>,
    ) -> PyResult<Vec<Gradients>> {
        let quantities = Quantity::ALL.map(|of| (of.name, of.objective));
        let objectives = named("objective", &objectives, &quantities)?;
        let features = named("feature", &features, &Feature::ALL)?;
        let values = self.values(&values)?;
        let found = watched(py, progress.as_ref(), |watch| {
            let see = &mut |motion: &str, state: &_| watch.at(Progress::of(motion, state));
            let plans = self.designed.plan(&values, see)?;
            if let Err(why) = plans.all_solved() {
                return Ok((plans, Err(why)));
            }
            let mut all = Vec::new();
            self.designed.each_optimum(&plans, see, &mut |mut optimal, parameters| {
                let mut numbers = Numbers::default();
                let motion = &plans.solutions[all.len()].plan.motion;
                let defined = objectives.iter().filter(|of| of.is_defined(motion));
                let defined: Vec<Objective> = defined.copied().collect();
                let gradients = optimal.gradients(&defined, parameters)?;
                let named = defined.into_iter().zip(gradients);
                numbers.objectives =
                    named.map(|(of, (value, slopes))| (of, value, slopes)).collect();
                let changes = match features.is_empty() {
                    true => Vec::new(),
                    false => optimal.changes(parameters)?,
                };
                for &feature in &features {
                    let by = changes.iter().map(|of| optimal.feature_change(feature, of));
                    let by = by.collect();
                    numbers.features.push((feature, optimal.feature(feature), by));
                }
                numbers.estimated = optimal.curvature() == Curvature::GaussNewton;
                all.push(numbers);
                Ok(())
            })?;
            Ok((plans, Ok(all)))
        })?;
        let (plans, all) = found.map_err(failed)?;
        let all = all.map_err(|_: Failed| {
            let lost: Vec<_> = plans.plans().filter(|of| !of.solve.status.is_solved()).collect();
            not_consistent(py, &lost)
        })?;
        let both = plans.solutions.iter().zip(all);
        both.map(|(solution, numbers)| {
            self.gradients_of(py, Plan::of(solution.plan.clone()), numbers)
        })
        .collect()
    }

    fn __repr__(&self) -> String {
        let file = &self.designed.file;
        let (parameters, motions) = (file.parameters.len(), file.motions.len());
        format!("<Design {}: {parameters} parameters, {motions} motions>", file.name)
    }
}

impl Design {
    /// Values of all parameters, of which some are given by name.
    fn values(&self, given: &HashMap<String, f64>) -> PyResult<Vec<f64>> {
        let parameters = &self.designed.file.parameters;
        let known = parameters.iter().map(|of| of.name.as_str()).collect::<Vec<_>>();
        if let Some(name) = given.keys().find(|name| !known.contains(&name.as_str())) {
            let known = known.join(", ");
            let design = &self.designed.file.name;
            return Err(refused(format!(
                "design `{design}` has no parameter `{name}`: it has {known}"
            )));
        }
        let both = parameters.iter().zip(self.designed.original());
        Ok(both.map(|(of, value)| given.get(&of.name).copied().unwrap_or(*value)).collect())
    }

    fn gradients_of(&self, py: Python<'_>, plan: Plan, of: Numbers) -> PyResult<Gradients> {
        let parameter_names: Vec<_> =
            self.designed.file.parameters.iter().map(|of| of.name.clone()).collect();
        let count = parameter_names.len();
        let mut found = Gradients {
            plan: Py::new(py, plan)?,
            parameter_names,
            objectives: HashMap::new(),
            gradients: HashMap::new(),
            features: HashMap::new(),
            jacobians: HashMap::new(),
            estimated: of.estimated,
        };
        for (objective, value, slopes) in of.objectives {
            let name = Quantity::of(objective).name;
            found.objectives.insert(name, value);
            found.gradients.insert(name, vector(py, slopes));
        }
        for (feature, values, by) in of.features {
            let jacobian = matrix(py, [values.len(), count], |at, k| by[k][at]);
            found.jacobians.insert(feature.name(), jacobian);
            found.features.insert(feature.name(), vector(py, values));
        }
        Ok(found)
    }
}

/// Values that names stand for.
fn named<T: Copy>(what: &str, names: &[String], known: &[(&'static str, T)]) -> PyResult<Vec<T>> {
    let find = |name: &String| {
        let found = known.iter().find(|(known, _)| known == name).map(|(_, value)| *value);
        found.ok_or_else(|| {
            let known: Vec<&str> = known.iter().map(|(name, _)| *name).collect();
            refused(format!("there is no {what} `{name}`: give one of {}", known.join(", ")))
        })
    };
    names.iter().map(find).collect()
}

fn failed(why: Failed) -> PyErr {
    match why {
        Failed::Robot(error) => wrong(error),
        other => refused(other),
    }
}
