//! Motions: what a robot is to do.

use crate::arrays::matrix;
use crate::documents::{Source, shipped};
use crate::error::wrong;
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
    /// The robot.
    pub robot: Arc<robot::Robot>,
    /// The motion.
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
    /// :param path: the file, such as `walk.toml`.
    /// :raises RollwalkError: everything that is wrong in one of them, with line, field and what would be right.
    /// :raises OSError: one of them cannot be read.
    #[staticmethod]
    fn from_file(path: PathBuf) -> PyResult<Self> {
        Source::Disk.motion(&path).map(Self::of)
    }

    /// Read the text of a motion file, for a robot.
    ///
    /// :param text: what the file says. Its `robot`, which motion files need, is not read.
    /// :param robot: the robot that does the motion.
    /// :param name: how errors name the text.
    /// :raises RollwalkError: everything that is wrong in it.
    #[staticmethod]
    #[pyo3(signature = (text, robot, name = "<motion>"))]
    fn from_toml(text: &str, robot: &Bound<'_, Robot>, name: &str) -> PyResult<Self> {
        let robot = Arc::clone(&robot.get().inner);
        let inner = motion::Motion::from_toml(name, text, &robot).map_err(wrong)?;
        Ok(Self { robot, inner })
    }

    /// A motion that ships with Rollwalk, with its robot.
    ///
    /// :param name: of its file, such as `walk`.
    /// :raises RollwalkError: there is none of this name; the message lists all.
    #[staticmethod]
    fn shipped(name: &str) -> PyResult<Self> {
        Source::Shipped.motion(&shipped("motions", name)).map(Self::of)
    }

    /// Name of the motion.
    #[getter]
    fn name(&self) -> &str {
        &self.inner.name
    }

    /// The robot that does it.
    #[getter]
    fn robot(&self) -> Robot {
        Robot { inner: Arc::clone(&self.robot) }
    }

    /// Duration, s; of a motion that repeats, its period.
    #[getter]
    fn duration_s(&self) -> f64 {
        self.inner.duration_s
    }

    /// Kind of the motion's ends: `periodic` or `at_rest`.
    #[getter]
    fn ends(&self) -> String {
        self.inner.ends.to_string()
    }

    /// Goal of the motion: forward, m, to the left, m, and turned to the left, rad; `None` where it has no goal.
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
