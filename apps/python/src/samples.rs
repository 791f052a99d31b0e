//! Plans sampled at any rate: the columns of `rollwalk export` as arrays.

use crate::arrays::{matrix, vector, vectors};
use crate::error::refused;
use numpy::{PyArray1, PyArray2, PyArray3};
use pyo3::prelude::*;
use rollwalk_planner::export::{Rate, Table};
use rollwalk_planner::plan::Plan;

/// A plan sampled at a rate, in the world frame with z up: T samples, J joints, E end effectors. The motion begins near the
/// origin.
///
/// The last row of a periodic motion is the one before the period repeats; other motions include both ends.
#[pyclass(frozen, get_all, module = "rollwalk")]
pub struct Samples {
    /// Rows per second.
    rate_hz: f64,
    /// Names of the joints, the columns of `joint_…`.
    joint_names: Vec<String>,
    /// Names of the end effectors, the columns of `contact…`, `wheel_…` and `motor_…`.
    end_effector_names: Vec<String>,
    /// Time from the start of the motion, s, shape (T,).
    time_s: Py<PyArray1<f64>>,
    /// Origin of the body, m, shape (T, 3).
    base_position_m: Py<PyArray2<f64>>,
    /// World-from-body rotation, quaternions with w first, shape (T, 4).
    base_orientation_wxyz: Py<PyArray2<f64>>,
    /// World-from-body rotation as intrinsic z-y-x angles, rad, shape (T, 3); yaw is not wrapped.
    base_yaw_pitch_roll_rad: Py<PyArray2<f64>>,
    /// Centre of mass, m, shape (T, 3).
    com_m: Py<PyArray2<f64>>,
    /// Velocity of the origin of the body, m/s, shape (T, 3).
    base_velocity_m_s: Py<PyArray2<f64>>,
    /// Angular velocity of the body in world axes, rad/s, shape (T, 3).
    base_angular_velocity_rad_s: Py<PyArray2<f64>>,
    /// Set-points of the joint angles, rad, shape (T, J).
    joint_rad: Py<PyArray2<f64>>,
    /// Set-points of the joint speeds, rad/s, shape (T, J).
    joint_speed_rad_s: Py<PyArray2<f64>>,
    /// Joint motor torques that the motion requires, N·m, shape (T, J).
    joint_torque_nm: Py<PyArray2<f64>>,
    /// True for each end effector in stance, shape (T, E).
    contact: Py<PyArray2<bool>>,
    /// Contact point of each end effector, m, shape (T, E, 3); the lowest point of the rim for wheels.
    contact_point_m: Py<PyArray3<f64>>,
    /// Ground force on each end effector, N, shape (T, E, 3).
    contact_force_n: Py<PyArray3<f64>>,
    /// Spin of each wheel about its axis relative to the ground, rad/s, shape (T, E); NaN for end effectors that do not roll.
    wheel_speed_rad_s: Py<PyArray2<f64>>,
    /// Speed of each wheel's motor, rad/s, shape (T, E); NaN for end effectors that do not roll.
    motor_speed_rad_s: Py<PyArray2<f64>>,
    /// Torque of each wheel's motor, N·m, shape (T, E); NaN without a motor.
    motor_torque_nm: Py<PyArray2<f64>>,
}

/// Iterator over the columns of a table in the order of docs/formats/plan-format.md. Columns are checked by the ends of their
/// names, because the beginnings contain names of joints.
struct Columns<'t> {
    table: &'t Table,
    next: usize,
}

impl Columns<'_> {
    /// Indices of the next columns. Panics unless the names of the columns end with `endings`.
    fn next<const N: usize>(&mut self, endings: [&str; N]) -> [usize; N] {
        endings.map(|ending| {
            let column = self.next;
            assert!(self.table.columns[column].ends_with(ending), "{ending}");
            self.next += 1;
            column
        })
    }
}

impl Samples {
    /// Samples a validated plan.
    pub fn of(py: Python<'_>, plan: &Plan, rate_hz: f64) -> PyResult<Self> {
        let rate = Rate::new(rate_hz).map_err(refused)?;
        let table = py.detach(|| Table::new(plan, rate));
        let mut columns = Columns { table: &table, next: 0 };
        let [time] = columns.next(["time_s"]);
        let position = columns.next(["base_x_m", "base_y_m", "base_z_m"]);
        let angles = columns.next(["base_yaw_rad", "base_pitch_rad", "base_roll_rad"]);
        let turned = columns.next(["base_qw", "base_qx", "base_qy", "base_qz"]);
        let com = columns.next(["com_x_m", "com_y_m", "com_z_m"]);
        let velocity = columns.next(["base_vx_m_s", "base_vy_m_s", "base_vz_m_s"]);
        let spin = columns.next(["base_wx_rad_s", "base_wy_rad_s", "base_wz_rad_s"]);
        let joint = |_| columns.next(["_rad", "_rad_s", "_nm"]);
        let joints: Vec<[usize; 3]> = plan.robot.joints.iter().map(joint).collect();
        let foot = |foot: &rollwalk_robot::EndEffector| {
            let all = ["_contact", "_x_m", "_y_m", "_z_m", "_fx_n", "_fy_n", "_fz_n"];
            let all = columns.next(all);
            let mut some = [None; 3];
            if foot.contact.rolls() {
                let of_wheel = ["_tilt_rad", "_yaw_rad", "_wheel_rad_s", "_motor_rad_s"];
                let [.., wheel, motor] = columns.next(of_wheel);
                some = [Some(wheel), Some(motor), None];
            }
            if foot.contact.actuator().is_some() {
                let [torque] = columns.next(["_motor_nm"]);
                some[2] = Some(torque);
            }
            (all, some)
        };
        let feet: Vec<([usize; 7], [Option<usize>; 3])> =
            plan.robot.end_effectors.iter().map(foot).collect();
        let value = |row: usize, column: usize| table.rows[row][column];
        let count = table.rows.len();
        let few = |of: &[usize]| matrix(py, [count, of.len()], |row, k| value(row, of[k]));
        let of_joint =
            |what: usize| matrix(py, [count, joints.len()], |row, k| value(row, joints[k][what]));
        let of_foot = |from: usize| {
            vectors(py, [count, feet.len()], |row, foot, axis| {
                value(row, feet[foot].0[from + axis])
            })
        };
        let of_wheel = |what: usize| {
            matrix(py, [count, feet.len()], |row, foot| {
                feet[foot].1[what].map_or(f64::NAN, |column| value(row, column))
            })
        };
        Ok(Self {
            rate_hz,
            joint_names: plan.robot.joints.iter().map(|of| of.name.clone()).collect(),
            end_effector_names: plan.robot.end_effectors.iter().map(|of| of.name.clone()).collect(),
            time_s: vector(py, (0..count).map(|row| value(row, time)).collect()),
            base_position_m: few(&position),
            base_orientation_wxyz: few(&turned),
            base_yaw_pitch_roll_rad: few(&angles),
            com_m: few(&com),
            base_velocity_m_s: few(&velocity),
            base_angular_velocity_rad_s: few(&spin),
            joint_rad: of_joint(0),
            joint_speed_rad_s: of_joint(1),
            joint_torque_nm: of_joint(2),
            contact: matrix(py, [count, feet.len()], |row, foot| {
                value(row, feet[foot].0[0]) != 0.0
            }),
            contact_point_m: of_foot(1),
            contact_force_n: of_foot(4),
            wheel_speed_rad_s: of_wheel(0),
            motor_speed_rad_s: of_wheel(1),
            motor_torque_nm: of_wheel(2),
        })
    }
}
