//! Designs: robots with variable parameters, and the derivatives of their plans with respect to these parameters.

use crate::arrays::{matrix, vector};
use crate::documents::{Source, shipped};
use crate::error::{input_error, refused};
use crate::plan::{Plan, Progress, not_consistent};
use crate::watch::watched;
use numpy::{PyArray1, PyArray2};
use pyo3::prelude::*;
use rollwalk_design::designed::Designed;
use rollwalk_design::goal::Quantity;
use rollwalk_design::plans::PlansError;
use rollwalk_planner::sensitivity::{Curvature, Feature, Objective};
use std::collections::HashMap;
use std::path::PathBuf;

/// A robot with variable parameters and the motions that it must do, as a design file describes them.
#[pyclass(frozen, module = "rollwalk")]
pub struct Design {
    designed: Designed,
}

/// Parameter of a robot in a design.
#[pyclass(frozen, get_all, module = "rollwalk")]
pub struct Parameter {
    /// Name in the design file.
    name: String,
    /// Value in the robot file, in `unit`.
    value: f64,
    /// Minimum value, in `unit`.
    min: f64,
    /// Maximum value, in `unit`.
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
/// the S samples of the plan: `pitch`, `tilt`, `joints` (rad), `height`, `body`, `feet` (m).
#[pyclass(frozen, get_all, module = "rollwalk")]
pub struct Gradients {
    /// Plan of the motion for the given parameter values.
    plan: Py<Plan>,
    /// Names of the parameters, in the order of the last axis of all derivatives.
    parameter_names: Vec<String>,
    /// Values at the optimum by name of the objective, in the unit of the objective.
    objectives: HashMap<&'static str, f64>,
    /// Derivatives by name of the objective, per unit of each parameter, shape (P,). Undefined objectives are left out, such as
    /// the cost of transport of a motion in place.
    gradients: HashMap<&'static str, Py<PyArray1<f64>>>,
    /// Values at the optimum by name of the feature, shape (F,): sample after sample, all components of each.
    features: HashMap<&'static str, Py<PyArray1<f64>>>,
    /// Derivatives ∂feature/∂parameter by name of the feature, shape (F, P).
    jacobians: HashMap<&'static str, Py<PyArray2<f64>>>,
    /// True if the derivatives are estimates with the Gauss-Newton curvature, because no optimum with positive second
    /// derivatives was found near the plan.
    estimated: bool,
}

/// Values and derivatives of a motion, before their conversion to arrays.
#[derive(Default)]
struct Numbers {
    objectives: Vec<(Objective, f64, Vec<f64>)>,
    /// Values, and their derivatives with respect to each parameter.
    features: Vec<(Feature, Vec<f64>, Vec<Vec<f64>>)>,
    /// True if the derivatives are estimates.
    estimated: bool,
}

#[pymethods]
impl Design {
    /// Read a design file (TOML), and the robot and motions that it names.
    ///
    /// :param path: path of the file, such as `agilebot_legs.toml`.
    /// :raises RollwalkError: all mistakes in one of the files, or parameters that do not fit the robot.
    /// :raises OSError: a file cannot be read.
    #[staticmethod]
    fn from_file(path: PathBuf) -> PyResult<Self> {
        Ok(Self { designed: Source::Disk.design(&path)? })
    }

    /// Load a design that ships with Rollwalk.
    ///
    /// :param name: name of its file, such as `agilebot_legs`.
    /// :raises RollwalkError: no design has this name; the message lists all names.
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

    /// Return the robot file for some values of the parameters, comments kept.
    ///
    /// :param values: values of parameters by name, in their units; other parameters keep the values of the robot file.
    /// :raises RollwalkError: the design lacks a parameter, or the robot breaks a rule.
    #[pyo3(signature = (values = HashMap::new()))]
    fn robot_toml(&self, values: HashMap<String, f64>) -> PyResult<String> {
        Ok(self.designed.at(&self.values(&values)?).map_err(input_error)?.text)
    }

    /// Plan all motions of the design, and compute the derivatives of the optimal plans with respect to all parameters (thesis
    /// 2.5.1).
    ///
    /// :param objectives: names of the objectives to differentiate, see `Gradients`.
    /// :param features: names of the features to differentiate, see `Gradients`.
    /// :param values: values of parameters by name, in their units; other parameters keep the values of the robot file.
    /// :param progress: called with a `Progress`, at most ten times a second. An exception of the callback ends the work.
    /// :returns: the derivatives of each motion, in the order of the design file.
    /// :raises RollwalkError: a name is unknown, or a plan has no derivatives.
    /// :raises NotConsistent: the robot cannot perform a motion.
    /// :raises KeyboardInterrupt: Ctrl-C was pressed; takes effect within an iteration.
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
        let all = all.map_err(|_: PlansError| {
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
    /// Values of all parameters: the given ones by name, all others from the robot file.
    fn values(&self, given: &HashMap<String, f64>) -> PyResult<Vec<f64>> {
        let parameters = &self.designed.file.parameters;
        let known = parameters.iter().map(|of| of.name.as_str()).collect::<Vec<_>>();
        if let Some(name) = given.keys().find(|name| !known.contains(&name.as_str())) {
            let known = known.join(", ");
            let design = &self.designed.file.name;
            return Err(refused(format!(
                "design `{design}` has no parameter `{name}`: give one of {known}"
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

/// Looks up the given names among `known`.
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

fn failed(why: PlansError) -> PyErr {
    match why {
        PlansError::Robot(error) => input_error(error),
        other => refused(other),
    }
}
