//! Motion as a table at any rate, for spreadsheets, notebooks and other programs.
//!
//! The table is written as CSV with a header line, or as JSON with the same columns. All values are instantaneous, from the
//! splines of [`crate::sample`]. Columns have their unit in their name; `docs/formats/plan-format.md` lists them.

use crate::motion::{Ends, Motion};
use crate::plan::Plan;
use crate::sample::PlanSpline;
use crate::torque::InverseDynamics;
use rollwalk_robot::Robot;
use serde::Serialize;
use std::collections::HashSet;
use thiserror::Error;

/// Error of a rate outside the valid range.
#[derive(Clone, Copy, Debug, PartialEq, Error)]
#[error("the rate is {rate_hz} Hz; expected a rate above 0 and up to {} Hz", Rate::MAX_HZ)]
pub struct RateError {
    /// Requested rate, Hz.
    pub rate_hz: f64,
}

/// Rate of an exported motion, Hz.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Rate(f64);

impl Rate {
    /// Maximum rate, Hz. A higher rate is probably a typing error.
    pub const MAX_HZ: f64 = 10_000.0;

    /// Creates a rate in Hz.
    ///
    /// # Errors
    /// Returns an error if the rate is not positive or exceeds 10 kHz.
    pub fn new(rate_hz: f64) -> Result<Self, RateError> {
        let is_rate = rate_hz > 0.0 && rate_hz <= Self::MAX_HZ;
        if is_rate { Ok(Self(rate_hz)) } else { Err(RateError { rate_hz }) }
    }

    /// Rate, Hz.
    pub fn hz(self) -> f64 {
        self.0
    }

    /// Times from the start of a motion to its end, both included, s. They are spaced evenly at [`even_hz`](Self::even_hz).
    pub fn times_s(self, duration_s: f64) -> impl Iterator<Item = f64> {
        let count = self.intervals(duration_s) as usize;
        (0..=count).map(move |number| duration_s * number as f64 / count as f64)
    }

    /// Nearest rate that divides a motion into equal intervals, Hz.
    pub fn even_hz(self, duration_s: f64) -> f64 {
        self.intervals(duration_s) / duration_s
    }

    fn intervals(self, duration_s: f64) -> f64 {
        (duration_s * self.0).round().max(1.0)
    }
}

/// Error of a length outside the valid range.
#[derive(Clone, Copy, Debug, PartialEq, Error)]
#[error("length {length_s} s; expected a length above 0 and up to {} s", Length::MAX_S)]
pub struct LengthError {
    /// Requested length, s.
    pub length_s: f64,
}

/// Length of an exported motion: periodic motions repeat for this time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Length(f64);

impl Length {
    /// Maximum length, s.
    pub const MAX_S: f64 = 3600.0;

    /// Creates a length in s.
    ///
    /// # Errors
    /// Returns an error if the length is not positive or exceeds an hour.
    pub fn new(length_s: f64) -> Result<Self, LengthError> {
        let is_length = length_s > 0.0 && length_s <= Self::MAX_S;
        if is_length { Ok(Self(length_s)) } else { Err(LengthError { length_s }) }
    }

    /// Length of a motion, s. A motion that is not periodic keeps its duration.
    pub fn of(self, motion: &Motion) -> f64 {
        if motion.ends == Ends::Periodic { self.0 } else { motion.duration_s }
    }
}

/// Motion sampled at a fixed rate.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Table {
    /// Always `rollwalk-export`.
    pub format: &'static str,
    /// Version of the format.
    pub version: u32,
    /// Name of the robot.
    pub robot: String,
    /// Name of the motion.
    pub motion: String,
    /// Number of rows per second.
    pub rate_hz: f64,
    /// Duration, s. For a periodic motion, its period.
    pub duration_s: f64,
    /// True if the first row follows the final one.
    pub periodic: bool,
    /// Names of the columns, with units.
    pub columns: Vec<String>,
    /// Rows at the multiples of 1/rate within the motion. Contact flags are 0 or 1.
    pub rows: Vec<Vec<f64>>,
}

impl Table {
    /// Samples a validated plan from its first to its final time. A periodic motion omits the time at which it repeats.
    pub fn new(plan: &Plan, Rate(rate_hz): Rate) -> Self {
        // Whole periods that rounding left a hair short still count.
        let last = (plan.motion.duration_s * rate_hz + 1e-6).floor();
        let periodic = plan.motion.ends == Ends::Periodic;
        let repeats = periodic && last + 1e-3 > plan.motion.duration_s * rate_hz;
        let count = if repeats { last as usize } else { last as usize + 1 };
        let (spline, mut inverse) = (PlanSpline::new(plan), InverseDynamics::new(plan));
        let time_s = |k: usize| (k as f64 / rate_hz).min(plan.motion.duration_s);
        Self {
            format: "rollwalk-export",
            version: 1,
            robot: plan.robot.name.clone(),
            motion: plan.motion.name.clone(),
            rate_hz,
            duration_s: plan.motion.duration_s,
            periodic,
            columns: columns(&plan.robot),
            rows: (0..count).map(|k| row(&spline, &mut inverse, time_s(k))).collect(),
        }
    }

    /// Returns the table as comma-separated values with a header line.
    pub fn to_csv(&self) -> String {
        let mut text = self.columns.join(",");
        text.push('\n');
        for row in &self.rows {
            let cells: Vec<String> = row.iter().map(f64::to_string).collect();
            text.push_str(&cells.join(","));
            text.push('\n');
        }
        text
    }

    /// Returns the table as JSON, one row per line.
    pub fn to_json(&self) -> String {
        // Only maps with non-string keys can fail to become JSON; a table has no map.
        let pretty = serde_json::to_string_pretty(self).unwrap_or_default();
        crate::plan::join_plain_arrays(&pretty) + "\n"
    }
}

/// Names of the columns, with the names of joints and end effectors from the robot file. If a name occurs twice, the later
/// column gets another. Columns of the body have priority over end effectors, and end effectors over joints.
fn columns(robot: &Robot) -> Vec<String> {
    let base = "time_s base_x_m base_y_m base_z_m base_yaw_rad base_pitch_rad base_roll_rad base_qw base_qx \
                base_qy base_qz com_x_m com_y_m com_z_m base_vx_m_s base_vy_m_s base_vz_m_s base_wx_rad_s \
                base_wy_rad_s base_wz_rad_s";
    let mut columns: Vec<String> = base.split_whitespace().map(str::to_owned).collect();
    let mut taken: HashSet<String> = columns.iter().cloned().collect();
    let mut unique = |name: &str, ending: &str, what: &str| {
        let mut column = format!("{name}_{what}");
        let mut name = name.to_owned();
        while !taken.insert(column.clone()) {
            name += ending;
            column = format!("{name}_{what}");
        }
        column
    };
    let mut feet = Vec::new();
    for end_effector in &robot.end_effectors {
        let foot = ["contact", "x_m", "y_m", "z_m", "fx_n", "fy_n", "fz_n"];
        let wheel = ["tilt_rad", "yaw_rad", "wheel_rad_s", "motor_rad_s"];
        let wheel = if end_effector.contact.rolls() { &wheel[..] } else { &[][..] };
        let motor = end_effector.contact.actuator().map(|_| &"motor_nm");
        let all = foot.iter().chain(wheel).chain(motor);
        feet.extend(all.map(|what| unique(&end_effector.name, "_foot", what)));
    }
    for joint in &robot.joints {
        columns.extend(["rad", "rad_s", "nm"].map(|what| unique(&joint.name, "_joint", what)));
    }
    columns.extend(feet);
    columns
}

fn row(spline: &PlanSpline, inverse: &mut InverseDynamics, time_s: f64) -> Vec<f64> {
    let sample = spline.sample(time_s);
    let setpoints = spline.setpoints(time_s);
    let (rates, _, actuation) = inverse.moving(time_s);
    let mut row = vec![time_s];
    row.extend(sample.base_position_m.iter().chain(&sample.base_yaw_pitch_roll_rad));
    row.extend(sample.base_orientation_wxyz.iter().chain(&sample.com_m));
    row.extend(&rates.state.velocity[..rollwalk_multibody::JOINTS]);
    for (k, torque_nm) in actuation.joint_nm.into_iter().enumerate() {
        row.extend([setpoints.joint_rad[k], setpoints.joint_speed_rad_s[k], torque_nm]);
    }
    let feet = spline.model().robot().end_effectors.iter().zip(&sample.end_effectors);
    for ((end_effector, e), torque_nm) in feet.zip(actuation.motor_nm) {
        row.push(f64::from(u8::from(e.contact)));
        row.extend(e.position_m.iter().chain(&e.force_n));
        if end_effector.contact.rolls() {
            row.extend([e.tilt_rad, e.yaw_rad, e.wheel_speed_rad_s, e.motor_speed_rad_s]);
        }
        row.extend(torque_nm);
    }
    row
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_plans;

    fn table(plan: &Plan, rate_hz: f64) -> Table {
        Table::new(plan, Rate::new(rate_hz).expect("a rate"))
    }

    fn column(table: &Table, name: &str) -> Vec<f64> {
        let index =
            table.columns.iter().position(|c| c == name).unwrap_or_else(|| panic!("no {name}"));
        table.rows.iter().map(|row| row[index]).collect()
    }

    #[test]
    fn a_motion_at_rest_has_both_ends_and_a_periodic_one_ends_before_it_repeats() {
        let rest = table(&test_plans::start_stop(), 60.0);
        assert_eq!(rest.rows.len(), 121);
        assert_eq!(column(&rest, "time_s")[120], 2.0);
        let periodic = table(&test_plans::cruise(), 60.0);
        assert_eq!(periodic.rows.len(), 72);
        // 1.2 s at 7 Hz: 8.4 rows; the moment of repetition is not on the grid.
        assert_eq!(table(&test_plans::cruise(), 7.0).rows.len(), 9);
    }

    #[test]
    fn columns_hold_what_their_names_say() {
        let plan = test_plans::start_stop();
        let table = table(&plan, 20.0);
        for (i, sample) in plan.samples.iter().enumerate() {
            let at = |name: &str| column(&table, name)[i];
            let near = |a: f64, b: f64| assert!((a - b).abs() < 1e-12, "sample {i}: {a} {b}");
            near(at("base_z_m"), sample.base_position_m[2]);
            near(at("com_x_m"), sample.com_m[0]);
            near(at("rl-hip_rad"), sample.joint_rad[2]);
            // Times that differ in the last bit change the end point of the force solver.
            let near = |a: f64, b: f64| assert!((a - b).abs() < 1e-7, "sample {i}: {a} {b}");
            near(at("rl-hip_nm"), sample.joint_torque_nm[2]);
            near(
                at("fr-wheel_motor_nm"),
                sample.end_effectors[1].motor_torque_nm.expect("a motor"),
            );
            near(at("fr-wheel_fz_n"), sample.end_effectors[1].force_n[2]);
            near(at("fr-wheel_x_m"), sample.end_effectors[1].position_m[0]);
            near(at("fr-wheel_contact"), 1.0);
        }
        // The integral of the body's speed is its displacement.
        let way: f64 = column(&table, "base_vx_m_s").iter().sum::<f64>() / 20.0;
        let moved = plan.samples[plan.samples.len() - 1].base_position_m[0];
        assert!((way - moved).abs() < 1e-3, "{way} {moved}");
        assert_eq!(column(&table, "base_wz_rad_s")[0], 0.0);
        // Speeds are derivatives: the legs move 0.3 rad in the first second, independent of the path.
        let mean = column(&table, "fl-hip_rad_s")[..20].iter().sum::<f64>() / 20.0;
        assert!((mean - 0.3).abs() < 1e-3, "{mean}"); // rectangle rule on a bump that vanishes at its ends
    }

    #[test]
    fn no_two_columns_have_one_name() {
        let mut robot = test_plans::robot();
        let before = columns(&robot);
        let wheel = robot.end_effectors[0].name.clone();
        robot.joints[0].name = format!("{wheel}_yaw");
        robot.end_effectors[1].name = "com".to_owned();
        let after = columns(&robot);
        let changed: Vec<_> =
            after.iter().zip(&before).filter(|(after, before)| after != before).collect();
        let named = |name: &str| after.iter().filter(|column| *column == name).count();
        for (column, count) in [
            (format!("{wheel}_yaw_rad"), 1),
            (format!("{wheel}_yaw_joint_rad"), 1),
            (format!("{wheel}_yaw_rad_s"), 1),
            ("com_x_m".to_owned(), 1),
            ("com_foot_x_m".to_owned(), 1),
            ("com_contact".to_owned(), 1),
        ] {
            assert_eq!(named(&column), count, "{column}");
        }
        assert_eq!(after.iter().collect::<HashSet<_>>().len(), after.len());
        assert_eq!(changed.len(), 3 + 12, "those of one joint and one wheel");
    }

    #[test]
    fn csv_and_json_say_the_same() {
        let table = table(&test_plans::cruise(), 60.0);
        let csv = table.to_csv();
        let mut lines = csv.lines();
        assert_eq!(lines.next(), Some(table.columns.join(",").as_str()));
        let json: serde_json::Value = serde_json::from_str(&table.to_json()).expect("JSON");
        for (line, row) in lines.zip(json["rows"].as_array().expect("rows")) {
            let cells: Vec<f64> = line.split(',').map(|c| c.parse().expect("a number")).collect();
            let row: Vec<f64> =
                row.as_array().expect("a row").iter().filter_map(|v| v.as_f64()).collect();
            assert_eq!(cells, row);
            assert_eq!(row.len(), table.columns.len());
        }
    }

    #[test]
    fn frames_have_the_rate_that_is_said() {
        let rate = Rate::new(7.0).expect("a rate");
        let times: Vec<_> = rate.times_s(1.6).collect();
        assert_eq!((times.len(), rate.even_hz(1.6)), (12, 6.875));
        assert!((times[1] - 1.0 / 6.875).abs() < 1e-12);
    }

    #[test]
    fn rates_that_are_none_are_refused() {
        for rate_hz in [0.0, -60.0, f64::NAN, f64::INFINITY, 1e9] {
            let error = Rate::new(rate_hz).expect_err("no rate");
            assert!(error.to_string().contains("above 0 and up to 10000 Hz"), "{error}");
        }
    }
}
