//! Robots, with their kinematics.

use crate::arrays::{matrix, vector};
use crate::documents::{Source, shipped};
use crate::error::{input_error, refused};
use nalgebra::{Matrix3, Quaternion, Rotation3, UnitQuaternion, Vector3};
use numpy::{PyArray1, PyArray2};
use pyo3::prelude::*;
use rollwalk_multibody::{Configuration, Frames, Standing, Tree};
use rollwalk_robot as robot;
use std::path::PathBuf;
use std::sync::Arc;

/// Positions (L, 3) and orientations (L, 4) of all links.
type Poses = (Py<PyArray2<f64>>, Py<PyArray2<f64>>);

/// A robot with legs and wheels, as its robot file describes it. Frames: x forward, y left, z up; the first link is the body.
#[pyclass(frozen, module = "rollwalk")]
pub struct Robot {
    /// Robot in the planner's form.
    pub inner: Arc<robot::Robot>,
}

impl Robot {
    /// Wraps a validated robot.
    pub fn of(robot: robot::Robot) -> Self {
        Self { inner: Arc::new(robot) }
    }

    /// Returns a value for each joint, as an array of shape (J,).
    fn of_joints(&self, py: Python<'_>, of: impl Fn(&robot::Joint) -> f64) -> Py<PyArray1<f64>> {
        vector(py, self.inner.joints.iter().map(of).collect())
    }
}

#[pymethods]
impl Robot {
    /// Read a robot file (TOML).
    ///
    /// :param path: path of the file, such as `pup.toml`.
    /// :raises RollwalkError: all mistakes in the file, with line, field and valid values.
    /// :raises OSError: the file cannot be read.
    #[staticmethod]
    fn from_file(path: PathBuf) -> PyResult<Self> {
        Source::Disk.robot(&path).map(Self::of)
    }

    /// Read the text of a robot file.
    ///
    /// :param text: text of the file.
    /// :param name: name of the text in error messages.
    /// :raises RollwalkError: all mistakes in the text.
    #[staticmethod]
    #[pyo3(signature = (text, name = "<robot>"))]
    fn from_toml(text: &str, name: &str) -> PyResult<Self> {
        robot::Robot::from_toml(name, text).map(Self::of).map_err(input_error)
    }

    /// Load a robot that ships with Rollwalk.
    ///
    /// :param name: name of its file, such as `agilebot`.
    /// :raises RollwalkError: no robot has this name; the message lists all names.
    #[staticmethod]
    fn shipped(name: &str) -> PyResult<Self> {
        Source::Shipped.robot(&shipped("robots", name)).map(Self::of)
    }

    /// Name of the robot.
    #[getter]
    fn name(&self) -> &str {
        &self.inner.name
    }

    /// Mass of all links, kg.
    #[getter]
    fn mass_kg(&self) -> f64 {
        self.inner.total_mass_kg()
    }

    /// Names of the L links; the first is the body.
    #[getter]
    fn link_names(&self) -> Vec<&str> {
        self.inner.links.iter().map(|link| link.name.as_str()).collect()
    }

    /// Names of the J joints, in the order of all arrays with a value for each joint.
    #[getter]
    fn joint_names(&self) -> Vec<&str> {
        self.inner.joints.iter().map(|joint| joint.name.as_str()).collect()
    }

    /// Names of the E end effectors (feet, wheels, blades), in the order of all arrays with a value for each end effector.
    #[getter]
    fn end_effector_names(&self) -> Vec<&str> {
        self.inner.end_effectors.iter().map(|of| of.name.as_str()).collect()
    }

    /// Joint angles of the standing pose, rad, shape (J,).
    #[getter]
    fn nominal_joint_rad(&self, py: Python<'_>) -> Py<PyArray1<f64>> {
        self.of_joints(py, |joint| joint.nominal_rad)
    }

    /// Minimum joint angles, rad, shape (J,).
    #[getter]
    fn joint_min_rad(&self, py: Python<'_>) -> Py<PyArray1<f64>> {
        self.of_joints(py, |joint| joint.position_min_rad)
    }

    /// Maximum joint angles, rad, shape (J,).
    #[getter]
    fn joint_max_rad(&self, py: Python<'_>) -> Py<PyArray1<f64>> {
        self.of_joints(py, |joint| joint.position_max_rad)
    }

    /// Speed limits of the joints' servos, rad/s, shape (J,).
    #[getter]
    fn joint_speed_max_rad_s(&self, py: Python<'_>) -> Py<PyArray1<f64>> {
        self.of_joints(py, |joint| joint.actuator.speed_max_rad_s)
    }

    /// Torque limits of the joints' servos, N·m, shape (J,).
    #[getter]
    fn joint_torque_max_nm(&self, py: Python<'_>) -> Py<PyArray1<f64>> {
        self.of_joints(py, |joint| joint.actuator.torque_max_nm)
    }

    /// Compute the poses of all links in the world.
    ///
    /// :param joint_rad: J joint angles, rad.
    /// :param base_position_m: origin of the body in the world, m.
    /// :param base_orientation_wxyz: world-from-body rotation, a quaternion with w first; normalised by this function.
    /// :returns: origins of the links, m, shape (L, 3), and their world-from-link quaternions with w first, shape (L, 4).
    /// :raises RollwalkError: the number of angles differs from the number of joints, or a value is not finite.
    #[pyo3(signature = (joint_rad, base_position_m = [0.0; 3], base_orientation_wxyz = [1.0, 0.0, 0.0, 0.0]))]
    fn link_poses(
        &self,
        py: Python<'_>,
        joint_rad: Vec<f64>,
        base_position_m: [f64; 3],
        base_orientation_wxyz: [f64; 4],
    ) -> PyResult<Poses> {
        let joints = self.inner.joints.len();
        if joint_rad.len() != joints {
            let (name, given) = (&self.inner.name, joint_rad.len());
            return Err(refused(format!(
                "{given} joint angles; expected {joints}, one for each joint of `{name}`"
            )));
        }
        let all = joint_rad.iter().chain(&base_position_m).chain(&base_orientation_wxyz);
        if let Some(wrong) = all.into_iter().find(|number| !number.is_finite()) {
            return Err(refused(format!("{wrong} in a pose; expected finite numbers")));
        }
        let [w, i, j, k] = base_orientation_wxyz;
        let rotation = UnitQuaternion::try_new(Quaternion::new(w, i, j, k), 1e-9);
        let rotation = rotation.ok_or_else(|| {
            refused("base_orientation_wxyz is 0; expected a quaternion (w, x, y, z)")
        })?;
        let at = Configuration {
            base_position_m: Vector3::from(base_position_m),
            world_from_body: rotation.to_rotation_matrix().into_inner(),
            joint_rad: &joint_rad,
        };
        Ok(poses(py, &Frames::new(&Tree::new(&self.inner), &at)))
    }

    /// Compute the poses of all links while the robot stands on level ground with its nominal joint angles.
    ///
    /// :returns: origins and quaternions, as from `link_poses`.
    /// :raises RollwalkError: the robot cannot stand with these angles.
    fn standing_link_poses(&self, py: Python<'_>) -> PyResult<Poses> {
        let standing = Standing::new(&Tree::new(&self.inner));
        let standing = standing.ok_or_else(|| {
            refused(format!("`{}` cannot stand with its nominal joint angles", self.inner.name))
        })?;
        Ok(poses(py, &standing.frames))
    }

    fn __repr__(&self) -> String {
        let robot::Robot { name, joints, end_effectors, .. } = &*self.inner;
        format!("<Robot {name}: {} joints, {} end effectors>", joints.len(), end_effectors.len())
    }
}

fn poses(py: Python<'_>, frames: &Frames) -> Poses {
    let links = frames.link_origins.len();
    let turned: Vec<[f64; 4]> = frames.world_from_link.iter().map(wxyz).collect();
    (
        matrix(py, [links, 3], |link, axis| frames.link_origins[link][axis]),
        matrix(py, [links, 4], |link, of| turned[link][of]),
    )
}

/// Converts a rotation matrix to a quaternion with w first.
pub fn wxyz(rotation: &Matrix3<f64>) -> [f64; 4] {
    let rotation = Rotation3::from_matrix_unchecked(*rotation);
    let turned = UnitQuaternion::from_rotation_matrix(&rotation);
    [turned.w, turned.i, turned.j, turned.k]
}
