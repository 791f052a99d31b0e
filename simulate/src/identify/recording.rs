//! What is known of a run: what drives were commanded, and what was measured.

use super::series::Series;
use crate::log::Table;
use nalgebra::{Matrix3, Quaternion, UnitQuaternion, Vector3};
use rollwalk_robot::{Channel, Robot};
use std::f64::consts::TAU;
use thiserror::Error;

/// A run.
#[derive(Clone, Debug, PartialEq)]
pub struct Recording {
    /// Begin and end, s.
    pub span_s: [f64; 2],
    /// Shortest time between two measurements of one thing, s.
    pub interval_s: f64,
    /// By channel.
    pub drives: Vec<Drive>,
    /// Origin of the body, m.
    pub position_m: Option<[Series; 3]>,
    /// World from body: w, x, y, z.
    pub orientation: Option<[Series; 4]>,
    /// Angular velocity of the body in its own axes, rad/s.
    pub gyro_rad_s: Option<[Series; 3]>,
}

/// A drive and its motor.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Drive {
    /// Commanded angle, rad; of wheels it does not matter.
    pub target_rad: Series,
    /// Commanded speed, rad/s.
    pub target_rad_s: Series,
    /// Commanded torque, N·m.
    pub feedforward_nm: Series,
    /// Measured angle, rad; empty if it was not.
    pub rad: Series,
    /// Measured speed, rad/s.
    pub rad_s: Series,
}

/// Why a table is no run of a robot.
#[derive(Debug, Error)]
pub enum TableError {
    /// A column is missing.
    #[error("there is no column `{name}`: {what}")]
    Missing {
        /// Its name.
        name: String,
        /// What it would have.
        what: &'static str,
    },
    /// No motor was measured.
    #[error("there is no column `{0}_rad` or `{0}_rad_s`, nor any other that has what a motor did")]
    Unmeasured(String),
    /// Times do not ascend.
    #[error("row {row}, column `time_s`: {time_s} s does not come after {before_s} s")]
    Order {
        /// Counted from 1, below the heading.
        row: usize,
        /// Its time.
        time_s: f64,
        /// That of the row before.
        before_s: f64,
    },
    /// The robot is held, fallen or without power all the time.
    #[error("the robot never stands on its own with its drives on for {0} s at a stretch")]
    Idle(f64),
}

/// Shortest run that is worth a fit, s.
pub const SHORTEST_S: f64 = 0.5;

/// Names of motors as columns have them, by channel.
pub fn motor_names(robot: &Robot) -> Vec<String> {
    let name = |channel| match channel {
        Channel::Joint(joint) => joint.name.clone(),
        Channel::Wheel(wheel, _) => format!("{}_motor", wheel.name),
    };
    robot.channels().map(name).collect()
}

impl Recording {
    /// Of a log of the simulated world, or any table with some of its columns: the longest stretch in which the robot is not held, has
    /// not fallen, and has its drives on.
    ///
    /// # Errors
    /// What is missing in it.
    pub fn from_table(table: &Table, robot: &Robot) -> Result<Self, TableError> {
        let missing = |name: &str, what| TableError::Missing { name: name.to_owned(), what };
        let time_s = table.column("time_s").ok_or_else(|| missing("time_s", "time of each row"))?;
        let is_later = |k: usize| time_s[k - 1] < time_s[k];
        if let Some(k) = (1..time_s.len()).find(|&k| !is_later(k)) {
            let (time_s, before_s) = (time_s[k], time_s[k - 1]);
            return Err(TableError::Order { row: k + 1, time_s, before_s });
        }
        let names = motor_names(robot);
        let rows = active(table, robot, &names, time_s.len());
        let span_s = [rows.start, rows.end.saturating_sub(1)].map(|row| time_s[row]);
        if span_s[1] - span_s[0] < SHORTEST_S {
            return Err(TableError::Idle(SHORTEST_S));
        }
        let series = |name: &str| {
            let values = table.column(name)?;
            Some(Series::new(rows.clone().map(|row| (time_s[row], values[row]))))
        };
        let mut drives = Vec::new();
        for (name, channel) in names.iter().zip(robot.channels()) {
            let of = |what: &str| series(&format!("{name}_{what}"));
            let (target, what, is_wheel) = match channel {
                Channel::Joint(_) => {
                    ("target_rad", "the angle that its drive was commanded", false)
                }
                Channel::Wheel(..) => {
                    ("target_rad_s", "the speed that its drive was commanded", true)
                }
            };
            if of(target).is_none_or(|commanded| commanded.is_empty()) {
                return Err(missing(&format!("{name}_{target}"), what));
            }
            let rad = of("rad").unwrap_or_default();
            drives.push(Drive {
                target_rad: of("target_rad").unwrap_or_default(),
                target_rad_s: of("target_rad_s").unwrap_or_default(),
                feedforward_nm: of("feedforward_nm").unwrap_or_default(),
                rad: if is_wheel { rad.unwrapped(TAU) } else { rad },
                rad_s: of("rad_s").unwrap_or_default(),
            });
        }
        if drives.iter().all(|drive| drive.rad.is_empty() && drive.rad_s.is_empty()) {
            return Err(TableError::Unmeasured(names[0].clone()));
        }
        let all = |names: [&str; 3]| -> Option<[Series; 3]> {
            let [x, y, z] = names.map(series);
            Some([x?, y?, z?]).filter(|all| all.iter().all(|series| !series.is_empty()))
        };
        let orientation = || {
            let [w, x, y, z] = ["base_qw", "base_qx", "base_qy", "base_qz"].map(series);
            Some([w?, x?, y?, z?]).filter(|all| all.iter().all(|series| !series.is_empty()))
        };
        let count = rows.len();
        Ok(Self {
            span_s,
            interval_s: (span_s[1] - span_s[0]) / (count - 1) as f64,
            drives,
            position_m: all(["base_x_m", "base_y_m", "base_z_m"]),
            orientation: orientation().map(one_sheet),
            gyro_rad_s: all(["gyro_x_rad_s", "gyro_y_rad_s", "gyro_z_rad_s"]),
        })
    }

    /// The same run, from and to some times, s.
    pub fn between(mut self, from_s: Option<f64>, to_s: Option<f64>) -> Self {
        let [begin_s, end_s] = self.span_s;
        self.span_s = [from_s.unwrap_or(begin_s).max(begin_s), to_s.unwrap_or(end_s).min(end_s)];
        self
    }

    /// Measured orientation at a time, if there is one within `half_s`.
    pub(super) fn orientation_at(&self, time_s: f64, half_s: f64) -> Option<Matrix3<f64>> {
        let [w, x, y, z] = self.orientation.as_ref()?;
        let at = |series: &Series| series.seen(time_s, half_s);
        Some(rotation([at(w)?, at(x)?, at(y)?, at(z)?]))
    }

    /// Of three numbers that are measured together.
    pub(super) fn vector_at(
        of: Option<&[Series; 3]>,
        time_s: f64,
        half_s: f64,
    ) -> Option<Vector3<f64>> {
        let [x, y, z] = of?;
        let at = |series: &Series| series.seen(time_s, half_s);
        Some(Vector3::new(at(x)?, at(y)?, at(z)?))
    }
}

/// A rotation matrix of parts of a quaternion that may have lost its length.
pub(super) fn rotation([w, x, y, z]: [f64; 4]) -> Matrix3<f64> {
    let turned = UnitQuaternion::from_quaternion(Quaternion::new(w, x, y, z));
    turned.to_rotation_matrix().into_inner()
}

/// A quaternion and its negative are the same orientation: takes the one that is nearer to that before.
fn one_sheet(parts: [Series; 4]) -> [Series; 4] {
    let count = parts.iter().map(|part| part.points().len()).min().unwrap_or(0);
    let mut points: Vec<[[f64; 2]; 4]> = Vec::with_capacity(count);
    for k in 0..count {
        let mut now = [0, 1, 2, 3].map(|part| parts[part].points()[k]);
        let dot = points.last().map_or(1.0, |last| {
            last.iter().zip(&now).map(|(last, now)| last[1] * now[1]).sum::<f64>()
        });
        if dot < 0.0 {
            now.iter_mut().for_each(|part| part[1] = -part[1]);
        }
        points.push(now);
    }
    [0, 1, 2, 3].map(|part| Series::new(points.iter().map(|all| (all[part][0], all[part][1]))))
}

/// The longest stretch of rows in which the robot stands on its own, and all drives of joints are on.
fn active(table: &Table, robot: &Robot, names: &[String], rows: usize) -> std::ops::Range<usize> {
    let flags = ["held", "fell"].map(|name| table.column(name));
    let joints = names.iter().take(robot.joints.len());
    // A drive that is off has no stiffness.
    let gains: Vec<_> =
        joints.filter_map(|name| table.column(&format!("{name}_kp_nm_rad"))).collect();
    let is_active = |row: usize| {
        flags.iter().flatten().all(|flag| flag[row] == 0.0)
            && gains.iter().all(|gain| gain[row] != 0.0)
    };
    let (mut best, mut start) = (0..0, 0);
    for row in 0..=rows {
        if row == rows || !is_active(row) {
            if row - start > best.len() {
                best = start..row;
            }
            start = row + 1;
        }
    }
    best
}
