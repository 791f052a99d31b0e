//! Motions: the goals and constraints that the planner receives.

use crate::arrays::matrix;
use crate::documents::{Source, shipped};
use crate::error::input_error;
use crate::robot::Robot;
use numpy::PyArray2;
use pyo3::prelude::*;
use rollwalk_planner::motion;
use rollwalk_robot as robot;
use std::path::PathBuf;
use std::sync::Arc;

/// Motion of a robot, as a motion file describes it: footfalls, goal, duration.
#[pyclass(frozen, module = "rollwalk")]
pub struct Motion {
    /// Robot of the motion.
    pub robot: Arc<robot::Robot>,
    /// Motion in the planner's form.
    pub inner: motion::Motion,
}

impl Motion {
    fn of((robot, inner): (robot::Robot, motion::Motion)) -> Self {
        Self { robot: Arc::new(robot), inner }
    }
}

#[pymethods]
impl Motion {
    /// Read a motion file (TOML) and the robot file that it names.
    ///
    /// :param path: path of the file, such as `walk.toml`.
    /// :raises RollwalkError: all mistakes in one of the files, with line, field and valid values.
    /// :raises OSError: a file cannot be read.
    #[staticmethod]
    fn from_file(path: PathBuf) -> PyResult<Self> {
        Source::Disk.motion(&path).map(Self::of)
    }

    /// Read the text of a motion file, for a given robot.
    ///
    /// :param text: text of the file. Its field `robot`, which motion files must have, is ignored.
    /// :param robot: the robot that does the motion.
    /// :param name: name of the text in error messages.
    /// :raises RollwalkError: all mistakes in the text.
    #[staticmethod]
    #[pyo3(signature = (text, robot, name = "<motion>"))]
    fn from_toml(text: &str, robot: &Bound<'_, Robot>, name: &str) -> PyResult<Self> {
        let robot = Arc::clone(&robot.get().inner);
        let inner = motion::Motion::from_toml(name, text, &robot).map_err(input_error)?;
        Ok(Self { robot, inner })
    }

    /// Load a motion that ships with Rollwalk, with its robot.
    ///
    /// :param name: name of its file, such as `walk`.
    /// :raises RollwalkError: no motion has this name; the message lists all names.
    #[staticmethod]
    fn shipped(name: &str) -> PyResult<Self> {
        Source::Shipped.motion(&shipped("motions", name)).map(Self::of)
    }

    /// Name of the motion.
    #[getter]
    fn name(&self) -> &str {
        &self.inner.name
    }

    /// Robot that does the motion.
    #[getter]
    fn robot(&self) -> Robot {
        Robot { inner: Arc::clone(&self.robot) }
    }

    /// Duration, s; the period of a periodic motion.
    #[getter]
    fn duration_s(&self) -> f64 {
        self.inner.duration_s
    }

    /// Kind of the motion's ends: `periodic` or `at_rest`.
    #[getter]
    fn ends(&self) -> String {
        self.inner.ends.to_string()
    }

    /// Goal of the motion: forward, m, left, m, and turn to the left, rad; `None` for components without a goal.
    #[getter]
    fn goal(&self) -> (Option<f64>, Option<f64>, Option<f64>) {
        let motion::Goal { forward_m, left_m, turn_rad } = self.inner.goal;
        (forward_m, left_m, turn_rad)
    }

    /// True for each end effector in stance at each sample, shape (S, E).
    #[getter]
    fn stance(&self, py: Python<'_>) -> Py<PyArray2<bool>> {
        let stance = &self.inner.stance;
        matrix(py, [stance.len(), self.robot.end_effectors.len()], |at, foot| stance[at][foot])
    }

    fn __repr__(&self) -> String {
        let motion::Motion { name, duration_s, ends, .. } = &self.inner;
        format!("<Motion {name} of {}: {duration_s} s, {ends}>", self.robot.name)
    }
}
