//! Table of a run. The row of a step contains pose, commands of the drives, states of the motors and contact forces.
//!
//! The caller that steps the world writes the table, with or without a bus. Format: `docs/formats/world-log.md`.

use nalgebra::UnitQuaternion;
use rollwalk_multibody::rotation::nearer_quaternion;
use rollwalk_physics::World;
use rollwalk_physics::motor::Law;
use rollwalk_robot::document::Excerpt;
use rollwalk_robot::{Channel, Robot};
use thiserror::Error;

/// Data of a step that its world does not contain.
#[derive(Clone, Copy, Debug)]
pub struct Moment<'a> {
    /// Simulated time, s.
    pub time_s: f64,
    /// Name of the motion that is played; empty if no motion is played.
    pub motion: &'a str,
    /// True if the hoist holds the body.
    pub is_held: bool,
    /// True if the robot has fallen.
    pub has_fallen: bool,
}

const BASE: [&str; 17] = [
    "time_s",
    "motion",
    "held",
    "fell",
    "base_x_m",
    "base_y_m",
    "base_z_m",
    "base_qw",
    "base_qx",
    "base_qy",
    "base_qz",
    "com_x_m",
    "com_y_m",
    "com_z_m",
    "com_vx_m_s",
    "com_vy_m_s",
    "com_vz_m_s",
];
const MOTOR: [&str; 9] = [
    "rad",
    "rad_s",
    "nm",
    "target_rad",
    "target_rad_s",
    "feedforward_nm",
    "kp_nm_rad",
    "kd_nm_s_rad",
    "limit_nm",
];
const END_EFFECTOR: [&str; 5] = ["normal_n", "fx_n", "fy_n", "fz_n", "slip_m_s"];

/// Header line of the table. Names of joints and end effectors come from the robot file.
pub fn heading(robot: &Robot) -> String {
    let motors = robot.channels().map(|channel| match channel {
        Channel::Joint(joint) => joint.name.clone(),
        Channel::Wheel(wheel, _) => format!("{}_motor", wheel.name),
    });
    let motors = motors.flat_map(|name| MOTOR.map(|what| format!("{name}_{what}")));
    let end_effectors = robot.end_effectors.iter();
    let end_effectors =
        end_effectors.flat_map(|of| END_EFFECTOR.map(|what| format!("{}_{what}", of.name)));
    record(BASE.map(str::to_owned).into_iter().chain(motors).chain(end_effectors))
}

/// Writer of the lines of a table.
#[derive(Default)]
pub struct Lines {
    /// Attitude in the previous line, w x y z; zeros before the first line.
    turned_wxyz: [f64; 4],
}

impl Lines {
    /// Returns the next line. Values have the digits of single precision.
    pub fn next(&mut self, moment: &Moment<'_>, world: &World) -> String {
        let &Moment { time_s, motion, is_held, has_fallen } = moment;
        let flag = |is: bool| u8::from(is).to_string();
        let first = [format!("{time_s:.6}"), motion.to_owned(), flag(is_held), flag(has_fallen)];
        let mut values = Vec::new();
        let (position, rotation) = world.base();
        let turned = UnitQuaternion::from_matrix(&rotation);
        let turned = [turned.w, turned.i, turned.j, turned.k];
        self.turned_wxyz = nearer_quaternion(turned, &self.turned_wxyz);
        let (com, velocity) = world.com();
        values.extend(&position);
        values.extend(self.turned_wxyz);
        values.extend(com.iter().chain(&velocity));
        for (channel, shaft) in world.shafts().enumerate() {
            let law = world.law(channel);
            let Law {
                kp_nm_rad, kd_nm_s_rad, position_rad, speed_rad_s, torque_nm, limit_nm, ..
            } = law;
            values.extend(shaft);
            values.extend([position_rad, speed_rad_s, torque_nm, kp_nm_rad, kd_nm_s_rad, limit_nm]);
        }
        for touch in world.touches() {
            values.push(touch.normal_n);
            values.extend(&touch.force);
            values.push(if touch.normal_n > 0.0 { touch.sliding.norm() } else { 0.0 });
        }
        let values = values.into_iter().map(|value| (value as f32).to_string());
        record(first.into_iter().chain(values))
    }
}

/// Formats cells as a CSV line without line end.
fn record(cells: impl Iterator<Item = String>) -> String {
    let mut writer = csv::Writer::from_writer(Vec::new());
    // Writing to a vector cannot fail, and cells are text.
    let written = writer.write_record(cells).and_then(|()| Ok(writer.flush()?));
    written.expect("memory takes it");
    let bytes = writer.into_inner().unwrap_or_default();
    String::from_utf8(bytes).unwrap_or_default().trim_end().to_owned()
}

/// Table of a run, read from a file.
#[derive(Clone, Debug, PartialEq)]
pub struct Table {
    /// Name of the motion of each row; empty if no motion was played.
    pub motions: Vec<String>,
    names: Vec<String>,
    /// Values by row. The column `motion` has the value 0, and skipped values are NaN.
    values: Vec<Vec<f64>>,
}

/// Error in a table.
#[derive(Debug, Error)]
pub enum LogError {
    /// Text that is not CSV.
    #[error("{0}")]
    Csv(#[from] csv::Error),
    /// Missing column.
    #[error("column `{0}` is missing")]
    Missing(&'static str),
    /// Cell that is not a number.
    #[error(
        "line {line}, column `{}`: `{}` is not a number",
        Excerpt::start_of(column),
        Excerpt::start_of(cell)
    )]
    Number {
        /// Line of the file, counted from 1.
        line: u64,
        /// Name of the column.
        column: String,
        /// Contents of the cell.
        cell: String,
    },
    /// Table with a heading only.
    #[error("the table has no rows")]
    Empty,
}

impl Table {
    /// Reads a table with all columns. Ignores an incomplete final line, which a killed simulator leaves.
    ///
    /// # Errors
    /// Returns an error if the text is not a table of a run, or if it has no rows.
    pub fn read(text: &str) -> Result<Self, LogError> {
        Self::read_with(text, &BASE, None)
    }

    /// Reads the times, and the columns selected by `is_read`, such as those that a real robot can record.
    ///
    /// An empty cell or NaN is a missing value. The contents of other columns are ignored.
    ///
    /// # Errors
    /// Returns an error if the text is not CSV, if the column `time_s` is missing, if a selected cell is not a number, or if
    /// there are no rows.
    pub fn read_some(text: &str, is_read: impl Fn(&str) -> bool) -> Result<Self, LogError> {
        Self::read_with(text, &BASE[..1], Some(&is_read))
    }

    /// Reads all columns, which must not have gaps, or only `columns` and those that `some` selects.
    fn read_with(
        text: &str,
        columns: &[&'static str],
        some: Option<&dyn Fn(&str) -> bool>,
    ) -> Result<Self, LogError> {
        let text = text.rfind('\n').map_or(text, |end| &text[..=end]);
        let mut reader = csv::Reader::from_reader(text.as_bytes());
        let names: Vec<String> = reader.headers()?.iter().map(str::to_owned).collect();
        let missing = columns.iter().find(|column| names.iter().all(|name| name != *column));
        if let Some(missing) = missing {
            return Err(LogError::Missing(missing));
        }
        let (mut motions, mut values) = (Vec::new(), Vec::new());
        for row in reader.records() {
            let row = row?;
            let number = |(cell, name): (&str, &String)| {
                if name == "motion" {
                    return Ok(0.0);
                }
                let is_needed = columns.iter().any(|column| name == column);
                if let Some(is_read) = some.filter(|_| !is_needed)
                    && (!is_read(name) || cell.is_empty() || cell.eq_ignore_ascii_case("nan"))
                {
                    return Ok(f64::NAN);
                }
                let written = |value: &f64| value.abs() <= f64::from(f32::MAX);
                cell.parse::<f64>().ok().filter(written).ok_or_else(|| {
                    let line = row.position().map_or(0, csv::Position::line);
                    LogError::Number { line, column: name.clone(), cell: cell.to_owned() }
                })
            };
            values.push(row.iter().zip(&names).map(number).collect::<Result<Vec<_>, _>>()?);
            let motion = row.iter().zip(&names).find(|(_, name)| *name == "motion");
            motions.push(motion.map_or_else(String::new, |(cell, _)| cell.to_owned()));
        }
        if values.is_empty() { Err(LogError::Empty) } else { Ok(Self { motions, names, values }) }
    }

    /// Values of a column; `None` if the table lacks it.
    pub fn column(&self, name: &str) -> Option<Vec<f64>> {
        let column = self.names.iter().position(|known| known == name)?;
        Some(self.values.iter().map(|row| row[column]).collect())
    }

    /// Prefixes of the column names with an ending, in order. The ending `_normal_n` yields `front_left` for
    /// `front_left_normal_n`.
    pub fn with_ending<'a>(&'a self, ending: &'a str) -> impl Iterator<Item = &'a str> {
        self.names.iter().filter_map(move |name| name.strip_suffix(ending))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Vector3;
    use rollwalk_multibody::ground::{Ground, Plane};
    use rollwalk_multibody::rotation::yaw_rotation;
    use rollwalk_physics::world::Parameters;
    use std::sync::Arc;

    fn robot() -> Robot {
        let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../../shipped/robots/car.toml");
        Robot::from_toml("car", &std::fs::read_to_string(path).unwrap()).unwrap()
    }

    #[test]
    fn what_is_written_is_read() {
        let robot = robot();
        let level: Arc<dyn Ground> = Arc::new(Plane::level());
        let mut world = World::standing(&robot, &level, &Parameters::new(&robot));
        let (mut text, mut lines) = (heading(&robot) + "\n", Lines::default());
        for step in 1..=20 {
            world.step(0.01).unwrap();
            let motion = if step > 10 { "a \"fast\", long drive" } else { "" };
            let time_s = 0.01 * f64::from(step);
            let moment = Moment { time_s, motion, is_held: false, has_fallen: step == 20 };
            text += &(lines.next(&moment, &world) + "\n");
        }
        let table = Table::read(&text).unwrap();
        assert_eq!(table.motions[9..11], ["", "a \"fast\", long drive"]);
        let column = |name: &str| table.column(name).expect(name);
        assert_eq!(column("time_s")[19], 0.2);
        assert_eq!(column("fell").iter().sum::<f64>(), 1.0);
        assert!((column("base_z_m")[19] - world.base().0.z).abs() < 1e-7);
        let wheels: Vec<_> = table.with_ending("_normal_n").collect();
        assert_eq!(wheels, ["front_left", "front_right", "rear_left", "rear_right"]);
        let weight_n: f64 =
            wheels.iter().map(|wheel| column(&format!("{wheel}_normal_n"))[19]).sum();
        let mass_kg: f64 = robot.links.iter().map(|link| link.mass_kg).sum();
        assert!((weight_n / (9.81 * mass_kg) - 1.0).abs() < 0.02, "{weight_n} N");
        assert_eq!(column("front_left_motor_kp_nm_rad")[0], 0.0);
        assert_eq!(column("front_left_motor_kd_nm_s_rad")[0], 0.5);
    }

    #[test]
    fn attitudes_do_not_change_their_sign_along_a_turn() {
        let robot = robot();
        let level: Arc<dyn Ground> = Arc::new(Plane::level());
        let mut world = World::standing(&robot, &level, &Parameters::new(&robot));
        let mut lines = Lines::default();
        let moment = Moment { time_s: 0.0, motion: "", is_held: true, has_fallen: false };
        let qw = BASE.iter().position(|name| *name == "base_qw").unwrap();
        let place = world.base().0 + Vector3::z();
        for tenths in 0..=50 {
            let angle_rad = 0.1 * f64::from(tenths);
            // A hoist turns the car about the vertical.
            world.hold(Some((place, yaw_rotation(angle_rad))));
            for _ in 0..20 {
                world.step(0.02).unwrap();
            }
            let line = lines.next(&moment, &world);
            let w: f64 = line.split(',').nth(qw).unwrap().parse().unwrap();
            assert!((w - (0.5 * angle_rad).cos()).abs() < 0.1, "{angle_rad} rad: {w}");
        }
    }

    #[test]
    fn faults_are_told_by_line_and_column() {
        let heading = heading(&robot());
        let why = |text: &str| Table::read(text).unwrap_err().to_string();
        assert_eq!(why("a,b\n1,2\n"), "column `time_s` is missing");
        assert_eq!(why(&heading), "the table has no rows");
        let row = |time: &str| {
            let zeros = vec!["0"; heading.split(',').count() - 1].join(",");
            format!("{heading}\n{time},{zeros}\n")
        };
        let mut cut = row("1") + &row("2").lines().nth(1).unwrap_or_default()[..20];
        assert_eq!(Table::read(&cut).unwrap().motions.len(), 1);
        cut.push('\n');
        assert!(why(&cut).contains("found record with"));
        assert!(why(&row("1e300")).contains("`1e300` is not a number"));
        assert_eq!(why(&row("soon")), "line 2, column `time_s`: `soon` is not a number");
        assert!(why(&row("NaN")).contains("`NaN` is not a number"));
        assert!(why(&row("")).contains("`` is not a number"));
        let some = |text: &str| Table::read_some(text, |name| name == "other");
        let other = some("time_s,other,note\n1,,ok\n2,NaN,\n3,3,NaN\n").unwrap();
        let other = other.column("other").unwrap();
        assert!(other[0].is_nan() && other[1].is_nan() && other[2] == 3.0);
        assert_eq!(some("other\n1\n").unwrap_err().to_string(), why("a,b\n1,2\n"));
        let long = "x\u{1b}[2J".repeat(1 << 20);
        let word = some(&format!("time_s,other\n1,{long}\n")).unwrap_err().to_string();
        assert!(word.len() < 1000 && word.contains("x\\u001b[2Jx"), "{word}");
        let word = some("time_s,other\n1,ok\n").unwrap_err().to_string();
        assert_eq!(word, "line 2, column `other`: `ok` is not a number");
        for time in ["", "nan"] {
            assert!(some(&format!("time_s,other\n{time},1\n")).is_err());
        }
        assert!(why(&format!("{heading}\n1,2\n")).contains("found record with 2 fields"));
    }
}
