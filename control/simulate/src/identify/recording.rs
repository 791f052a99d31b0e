//! Recording of a run: commands of the drives, and measurements.

use super::series::Series;
use crate::log::{LogError, Table};
use nalgebra::{Matrix3, Quaternion, UnitQuaternion, Vector3};
use rollwalk_robot::document::Excerpt;
use rollwalk_robot::{Channel, Robot};
use std::f64::consts::TAU;
use thiserror::Error;

/// Recorded run.
#[derive(Clone, Debug, PartialEq)]
pub struct Recording {
    /// Start and end of the fitted span, s.
    pub span_s: [f64; 2],
    /// Shortest of the mean intervals between samples of the measured series, s.
    pub interval_s: f64,
    /// Drives in channel order.
    pub drives: Vec<DriveSeries>,
    /// Position of the body's origin, m.
    pub position_m: Option<[Series; 3]>,
    /// World-from-body quaternion: w, x, y, z.
    pub orientation: Option<[Series; 4]>,
    /// Angular velocity in body axes, rad/s.
    pub gyro_rad_s: Option<[Series; 3]>,
}

/// Time series of a drive: commands, and measured angle and speed.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct DriveSeries {
    /// Commanded angle, rad; ignored for wheels.
    pub target_rad: Series,
    /// Commanded speed, rad/s.
    pub target_rad_s: Series,
    /// Commanded torque, N·m.
    pub feedforward_nm: Series,
    /// Measured angle, rad; empty if it was not measured.
    pub rad: Series,
    /// Measured speed, rad/s; empty if it was not measured.
    pub rad_s: Series,
}

/// Error of a table that is not a run of a robot.
#[derive(Debug, Error)]
pub enum TableError {
    /// Table that cannot be read.
    #[error("{0}")]
    Log(#[from] LogError),
    /// Missing column.
    #[error("column `{name}` is missing: {what}")]
    Missing {
        /// Name of the column.
        name: String,
        /// Contents of the column.
        what: &'static str,
    },
    /// Table with motors of another robot.
    #[error(
        "the run is of another robot: the table has the motor `{}`, but no motor of {robot}, such \
         as `{expected}`",
        Excerpt::start_of(found)
    )]
    OtherRobot {
        /// Name of the robot.
        robot: String,
        /// Motor of the robot.
        expected: String,
        /// Motor in the table.
        found: String,
    },
    /// Table without motor measurements.
    #[error(
        "no column has the measured angle or speed of a motor, such as `{0}_rad` or \
        `{0}_rad_s`"
    )]
    Unmeasured(String),
    /// Times that do not ascend.
    #[error(
        "row {row}, column `time_s`: {time_s} s is not later than {before_s} s in the row \
        above"
    )]
    Order {
        /// Row below the heading, counted from 1.
        row: usize,
        /// Time of the row, s.
        time_s: f64,
        /// Time of the previous row, s.
        before_s: f64,
    },
    /// Run without a span that can be fitted.
    #[error(transparent)]
    Idle(#[from] NoMovement),
}

/// Error of a run without a usable span: the robot is held, fallen or without power all the time, or the requested span is too
/// short.
#[derive(Clone, Copy, Debug, Error, PartialEq)]
#[error(
    "{span}the robot never stands unsupported with its drives on for {SHORTEST_S} s without \
     interruption",
    span = within(from_s, to_s)
)]
pub struct NoMovement {
    /// Requested start of the span, s.
    pub from_s: Option<f64>,
    /// Requested end of the span, s.
    pub to_s: Option<f64>,
}

fn within(from_s: &Option<f64>, to_s: &Option<f64>) -> String {
    match (from_s, to_s) {
        (Some(from_s), Some(to_s)) => format!("from {from_s} to {to_s} s "),
        (Some(from_s), None) => format!("from {from_s} s on "),
        (None, Some(to_s)) => format!("up to {to_s} s "),
        (None, None) => String::new(),
    }
}

/// Requested start and end of the span to fit, s; `None` if unrestricted.
pub type RequestedSpan = [Option<f64>; 2];

/// Duration of the shortest run that can be fitted, s.
pub const SHORTEST_S: f64 = 0.5;

/// Names of the motors in column names, in channel order.
pub fn motor_names(robot: &Robot) -> Vec<String> {
    let name = |channel| match channel {
        Channel::Joint(joint) => joint.name.clone(),
        Channel::Wheel(wheel, _) => format!("{}_motor", wheel.name),
    };
    robot.channels().map(name).collect()
}

/// Columns of the flags for a robot that is held or has fallen.
const FLAGS: [&str; 2] = ["held", "fell"];
/// Columns of the body position.
const PLACE: [&str; 3] = ["base_x_m", "base_y_m", "base_z_m"];
/// Columns of the body orientation.
const ORIENTATION: [&str; 4] = ["base_qw", "base_qx", "base_qy", "base_qz"];
/// Columns of the angular velocity.
const GYRO: [&str; 3] = ["gyro_x_rad_s", "gyro_y_rad_s", "gyro_z_rad_s"];
/// Column name endings of a motor.
const MOTOR: [&str; 6] =
    ["target_rad", "target_rad_s", "feedforward_nm", "rad", "rad_s", "kp_nm_rad"];

impl Recording {
    /// Reads a log of the simulated world, or any table with some of its columns. Other columns are ignored.
    ///
    /// # Errors
    /// Returns an error if the table cannot be read, a time or command column is missing, or times do not ascend. Also returns an
    /// error if the motors are not those of `robot` or were not measured, or no span can be fitted.
    pub fn from_text(
        text: &str,
        robot: &Robot,
        wanted_s: RequestedSpan,
    ) -> Result<Self, TableError> {
        let names = motor_names(robot);
        let is_read = |column: &str| {
            let plain = [&FLAGS[..], &PLACE, &ORIENTATION, &GYRO].concat();
            let of_motor = |name: &String| {
                let what = column.strip_prefix(name.as_str()).and_then(|of| of.strip_prefix('_'));
                what.is_some_and(|what| MOTOR.contains(&what))
            };
            plain.contains(&column) || names.iter().any(of_motor)
        };
        Self::from_table(&Table::read_some(text, is_read)?, robot, &names, wanted_s)
    }

    fn from_table(
        table: &Table,
        robot: &Robot,
        names: &[String],
        wanted_s: RequestedSpan,
    ) -> Result<Self, TableError> {
        let missing = |name: &str, what| TableError::Missing { name: name.to_owned(), what };
        let time_s = table.column("time_s").ok_or_else(|| missing("time_s", "time of each row"))?;
        let is_later = |k: usize| time_s[k - 1] < time_s[k];
        if let Some(k) = (1..time_s.len()).find(|&k| !is_later(k)) {
            let (time_s, before_s) = (time_s[k], time_s[k - 1]);
            return Err(TableError::Order { row: k + 1, time_s, before_s });
        }
        let series = |name: &str| {
            let values = table.column(name)?;
            Some(Series::new(time_s.iter().copied().zip(values))).filter(|known| !known.is_empty())
        };
        if let Some(found) = other_motor(table, names) {
            let (robot, expected) = (robot.name.clone(), names[0].clone());
            return Err(TableError::OtherRobot { robot, expected, found });
        }
        let mut drives = Vec::new();
        for (name, channel) in names.iter().zip(robot.channels()) {
            let of = |what: &str| series(&format!("{name}_{what}"));
            let (target, what) = match channel {
                Channel::Joint(_) => ("target_rad", "the commanded angle of the drive"),
                Channel::Wheel(..) => ("target_rad_s", "the commanded speed of the drive"),
            };
            if of(target).is_none() {
                return Err(missing(&format!("{name}_{target}"), what));
            }
            drives.push(DriveSeries {
                target_rad: of("target_rad").unwrap_or_default(),
                target_rad_s: of("target_rad_s").unwrap_or_default(),
                feedforward_nm: of("feedforward_nm").unwrap_or_default(),
                rad: of("rad").unwrap_or_default(),
                rad_s: of("rad_s").unwrap_or_default(),
            });
        }
        if drives.iter().all(|drive| drive.rad.is_empty() && drive.rad_s.is_empty()) {
            return Err(TableError::Unmeasured(names[0].clone()));
        }
        let all = |names: [&str; 3]| -> Option<[Series; 3]> {
            let [x, y, z] = names.map(series);
            Some([x?, y?, z?])
        };
        let orientation = || {
            let [w, x, y, z] = ORIENTATION.map(series);
            Some([w?, x?, y?, z?])
        };
        let (position_m, gyro_rad_s) = (all(PLACE), all(GYRO));
        let run = Self::new(robot, drives, position_m, orientation(), gyro_rad_s);
        Ok(run.cut(&active(table, robot, names, &time_s), wanted_s)?)
    }

    /// Creates a recording of a robot from its available measurements. Call [`cut`](Self::cut) to select the span to fit.
    pub fn new(
        robot: &Robot,
        mut drives: Vec<DriveSeries>,
        position_m: Option<[Series; 3]>,
        orientation: Option<[Series; 4]>,
        gyro_rad_s: Option<[Series; 3]>,
    ) -> Self {
        for (drive, channel) in drives.iter_mut().zip(robot.channels()) {
            if matches!(channel, Channel::Wheel(..)) {
                drive.rad = std::mem::take(&mut drive.rad).unwrapped(TAU);
            }
        }
        let orientation = orientation.map(one_sheet);
        let none = [f64::NEG_INFINITY, f64::INFINITY];
        Self { span_s: none, interval_s: 0.0, drives, position_m, orientation, gyro_rad_s }
    }

    /// Cuts the recording to the longest of some time intervals, each limited to the requested span.
    ///
    /// In these intervals the robot stands on its own, and its drives are on.
    ///
    /// # Errors
    /// Returns an error if no interval is at least [`SHORTEST_S`] long, or if nothing was measured in it.
    pub fn cut(
        mut self,
        stretches_s: &[[f64; 2]],
        wanted_s: RequestedSpan,
    ) -> Result<Self, NoMovement> {
        let [from_s, to_s] = wanted_s;
        let wanted = |[begin_s, end_s]: &[f64; 2]| {
            [begin_s.max(from_s.unwrap_or(*begin_s)), end_s.min(to_s.unwrap_or(*end_s))]
        };
        let length_s = |[begin_s, end_s]: &[f64; 2]| end_s - begin_s;
        let longest = stretches_s
            .iter()
            .map(wanted)
            .filter(|span_s| length_s(span_s) >= SHORTEST_S)
            // If several are equally long, the first wins.
            .rev()
            .max_by(|one, other| length_s(one).total_cmp(&length_s(other)));
        self.span_s = longest.ok_or(NoMovement { from_s, to_s })?;
        let span_s = self.span_s;
        let place = self.position_m.iter_mut().flatten();
        let turned = self.orientation.iter_mut().flatten();
        let gyro = self.gyro_rad_s.iter_mut().flatten();
        let motors = self.drives.iter_mut().flat_map(|drive| [&mut drive.rad, &mut drive.rad_s]);
        let measured = motors.chain(place).chain(turned).chain(gyro);
        let intervals = measured.filter_map(|series| {
            *series = std::mem::take(series).between(span_s);
            series.interval_s()
        });
        self.interval_s = intervals.min_by(f64::total_cmp).ok_or(NoMovement { from_s, to_s })?;
        Ok(self)
    }

    /// Measured orientation at `time_s`; `None` without a measurement within `half_s`.
    pub(super) fn orientation_at(&self, time_s: f64, half_s: f64) -> Option<Matrix3<f64>> {
        let [w, x, y, z] = self.orientation.as_ref()?;
        let at = |series: &Series| series.value_near(time_s, half_s);
        Some(rotation([at(w)?, at(x)?, at(y)?, at(z)?]))
    }

    /// Measured vector at `time_s`; `None` without a measurement within `half_s`.
    pub(super) fn vector_at(
        of: Option<&[Series; 3]>,
        time_s: f64,
        half_s: f64,
    ) -> Option<Vector3<f64>> {
        let [x, y, z] = of?;
        let at = |series: &Series| series.value_near(time_s, half_s);
        Some(Vector3::new(at(x)?, at(y)?, at(z)?))
    }
}

/// Name of a commanded motor in a table; `None` if the table has a commanded motor of the robot.
fn other_motor(table: &Table, names: &[String]) -> Option<String> {
    let commanded = || {
        ["_target_rad", "_target_rad_s"].into_iter().flat_map(|ending| table.with_ending(ending))
    };
    let is_own = |motor: &str| names.iter().any(|name| name == motor);
    if commanded().any(is_own) { None } else { commanded().next().map(str::to_owned) }
}

/// Rotation matrix of a quaternion that may not be normalised.
pub(super) fn rotation([w, x, y, z]: [f64; 4]) -> Matrix3<f64> {
    let turned = UnitQuaternion::from_quaternion(Quaternion::new(w, x, y, z));
    turned.to_rotation_matrix().into_inner()
}

/// Selects the signs of a series of quaternions so that consecutive ones are close: a quaternion and its negative are the same
/// rotation.
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

/// Time intervals in which the robot stands on its own and the drives of all joints are on.
fn active(table: &Table, robot: &Robot, names: &[String], time_s: &[f64]) -> Vec<[f64; 2]> {
    let flags = FLAGS.map(|name| table.column(name));
    let joints = names.iter().take(robot.joints.len());
    // A drive that is off has no stiffness.
    let gains: Vec<_> =
        joints.filter_map(|name| table.column(&format!("{name}_kp_nm_rad"))).collect();
    let is_active = |row: &usize| {
        !flags.iter().flatten().any(|flag| flag[*row] > 0.0)
            && gains.iter().all(|gain| gain[*row] != 0.0)
    };
    let rows: Vec<usize> = (0..time_s.len()).collect();
    let stretches = rows.chunk_by(|one, next| is_active(one) == is_active(next));
    let stretches = stretches.filter(|rows| is_active(&rows[0]));
    stretches.map(|rows| [time_s[rows[0]], time_s[rows[rows.len() - 1]]]).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn car() -> Robot {
        let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../../shipped/robots/car.toml");
        Robot::from_toml("car", &std::fs::read_to_string(path).unwrap()).unwrap()
    }

    /// Table of motors that turn for 6 s at 100 Hz, in a hoist from 2 s to 3 s, with additional columns that are ignored.
    fn table(robot: &Robot) -> String {
        let names = motor_names(robot);
        let motors = names.iter().map(|name| format!(",{name}_target_rad_s,{name}_rad"));
        let mut text = format!("time_s,held,note,left_over{}\n", motors.collect::<String>());
        for step in 0..=600 {
            let time_s = f64::from(step) * 0.01;
            let held = u8::from((2.0..3.0).contains(&time_s));
            let motors = format!(",1,{time_s}").repeat(names.len());
            text += &format!("{time_s},{held},rough floor,NaN{motors}\n");
        }
        text
    }

    #[test]
    fn the_longest_stretch_of_what_is_wanted_is_taken() {
        let robot = car();
        let text = table(&robot);
        let span_s = |from_s, to_s| {
            let run = Recording::from_text(&text, &robot, [from_s, to_s]).unwrap();
            assert!((run.interval_s - 0.01).abs() < 1e-9);
            run.span_s
        };
        assert_eq!(span_s(None, None), [3.0, 6.0]);
        assert_eq!(span_s(None, Some(2.5)), [0.0, 1.99]);
        assert_eq!(span_s(Some(0.5), Some(4.0)), [0.5, 1.99]);
        let error = Recording::from_text(&text, &robot, [Some(1.8), Some(3.2)]).unwrap_err();
        assert!(error.to_string().starts_with("from 1.8 to 3.2 s the robot never"), "{error}");
    }

    #[test]
    fn a_table_of_another_robot_is_named_as_such() {
        let robot = car();
        let text = table(&robot);
        let [first, second] = [0, 1].map(|number| motor_names(&robot)[number].clone());
        let error =
            |text: &str| Recording::from_text(text, &robot, [None; 2]).unwrap_err().to_string();
        let mut other = text.clone();
        for name in motor_names(&robot) {
            other = other.replace(&name, &format!("other_{name}"));
        }
        let found = error(&other);
        assert!(
            found.contains("another robot") && found.contains(&format!("`{first}`")),
            "{found}"
        );
        assert!(found.contains(&format!("`other_{first}`")), "{found}");
        // A file without the columns of one motor may still be the right file.
        let found = error(&text.replace(&format!("{second}_target_rad_s"), "gone"));
        assert!(
            found.starts_with(&format!("column `{second}_target_rad_s` is missing")),
            "{found}"
        );
    }

    #[test]
    fn only_columns_that_are_used_must_be_numbers() {
        let robot = car();
        let text = table(&robot);
        let name = &motor_names(&robot)[0];
        let word = text.replacen("0,0,rough floor,NaN,1,", "0,0,rough floor,NaN,fast,", 1);
        let error = Recording::from_text(&word, &robot, [None; 2]).unwrap_err().to_string();
        assert_eq!(error, format!("line 2, column `{name}_target_rad_s`: `fast` is not a number"));
    }
}
