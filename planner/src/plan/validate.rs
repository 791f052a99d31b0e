//! Validation of plans before use: counts, finite values, unit quaternions, times on the grid, and ends that agree with the
//! kind of motion.

mod ends;

use super::json::JSON;
use super::{EndEffectorSample, FORMAT, Plan, PlanError, Sample, Status, VERSION};
use crate::families::{AGREEMENT, Kind};
use crate::motion::{Ends, LONGEST_S, Reserve, Subject};
use nalgebra::{Quaternion, Rotation3, UnitQuaternion};
use rollwalk_protocol::library::MAX_NAME;
use rollwalk_protocol::text::{Printable, is_plain_name};
use std::fmt::Display;

/// Minimum number of samples for which periodic splines and second differences are defined.
const MIN_SAMPLES: usize = 3;
/// Maximum number of samples in a file. Motion files and refinement allow fewer.
const MAX_SAMPLES: usize = 1000;
/// Maximum length of a name, bytes: that of a transition, which names both motions that it joins.
const MAX_PLAN_NAME: usize = 2 * MAX_NAME + " to ".len();

impl Plan {
    /// Checks that the plan is complete and consistent. Errors name the plan by `file`.
    ///
    /// # Errors
    /// Returns an error if a field is invalid. [`PlanError`] names the first such field.
    pub fn validate(&self, file: &str) -> Result<(), PlanError> {
        let at = Field { file, path: String::new() };
        at.of("format").holds(self.format == FORMAT, &self.format, FORMAT)?;
        at.of("version").holds(self.version == VERSION, self.version, VERSION)?;
        self.robot.validate().map_err(|error| PlanError::Robot { file: file.to_owned(), error })?;
        self.validate_grid(&at)?;
        for (index, (sample, stance)) in self.samples.iter().zip(&self.motion.stance).enumerate() {
            let at = at.item("samples", index);
            self.validate_sample(sample, &at)?;
            let expected_s = index as f64 * self.sample_interval_s;
            at.of("time_s").near(sample.time_s, expected_s, "the index times sample_interval_s")?;
            for (j, (end_effector, &stands)) in sample.end_effectors.iter().zip(stance).enumerate()
            {
                let ok = end_effector.contact == stands;
                let expected = format!("{stands}, as in motion.stance[{index}][{j}]");
                at.item("end_effectors", j).of("contact").holds(
                    ok,
                    end_effector.contact,
                    expected,
                )?;
            }
        }
        self.validate_diagnosis(&at.of("solve"))?;
        self.validate_timing(&at)?;
        self.validate_sample(&self.before, &at.of("before"))?;
        self.validate_sample(&self.after, &at.of("after"))?;
        self.validate_ends(&at)
    }

    /// Checks that sample count, footfall pattern, duration and spacing agree.
    fn validate_grid(&self, at: &Field) -> Result<(), PlanError> {
        let count = self.samples.len();
        let feet = self.robot.end_effectors.len();
        at.of("samples").holds(
            count >= MIN_SAMPLES,
            format!("{count} samples long"),
            format!("at least {MIN_SAMPLES} samples"),
        )?;
        at.of("samples").holds(
            count <= MAX_SAMPLES,
            format!("{count} samples long"),
            format!("at most {MAX_SAMPLES} samples"),
        )?;
        let name = &self.motion.name;
        at.of("motion.name").holds(
            is_plain_name(name) && name.len() <= MAX_PLAN_NAME,
            format!("\"{}\"", Printable(name)),
            format!(
                "1 to {MAX_PLAN_NAME} bytes of visible characters, without a space at the start or \
                 end"
            ),
        )?;
        let (angles, joints) = (self.motion.posture_rad.len(), self.robot.joints.len());
        at.of("motion.posture_rad").holds(
            angles == joints && self.motion.posture_rad.iter().all(|angle| angle.is_finite()),
            format!("{angles} angles"),
            format!("{joints} finite angles, one for each joint"),
        )?;
        if let Some(lying_rad) = &self.motion.lying_rad {
            let angles = lying_rad.len();
            at.of("motion.lying_rad").holds(
                angles == joints && lying_rad.iter().all(|angle| angle.is_finite()),
                format!("{angles} angles"),
                format!("{joints} finite angles, one for each joint"),
            )?;
            at.of("robot.end_effectors").holds(
                self.robot.has_body_points(),
                "without body points",
                "end effectors of kind body_point, on which the motion lies",
            )?;
        }
        let held = &self.motion.held_wheels;
        at.of("motion.held_wheels").holds(
            held.len() == feet,
            format!("{} flags long", held.len()),
            format!("one flag for each of the {feet} end effectors"),
        )?;
        for (j, foot) in self.robot.end_effectors.iter().enumerate() {
            at.item("motion.held_wheels", j).holds(
                !held[j] || foot.contact.actuator().is_some(),
                format!("true for `{}`", foot.name),
                "false, because this end effector has no wheel with a motor",
            )?;
        }
        self.validate_choreography(at)?;
        let stance = &self.motion.stance;
        at.of("motion.stance").holds(
            stance.len() == count,
            format!("{} rows long", stance.len()),
            format!("one row for each of the {count} samples"),
        )?;
        for (i, row) in stance.iter().enumerate() {
            at.item("motion.stance", i).holds(
                row.len() == feet,
                format!("{} flags long", row.len()),
                format!("one flag for each of the {feet} end effectors"),
            )?;
        }
        let Reserve { torque_use, speed_use } = self.motion.reserve;
        for (name, share) in [("torque_use", torque_use), ("speed_use", speed_use)] {
            let ok = share > 0.0 && share <= 1.0;
            at.of("motion.reserve").of(name).holds(
                ok,
                share,
                "a fraction above 0 and at most 1",
            )?;
        }
        let duration_s = self.motion.duration_s;
        let of_motion = duration_s > 0.0 && duration_s <= LONGEST_S;
        let expected = format!("a time above 0 s and at most {LONGEST_S:.2} s");
        at.of("motion.duration_s").holds(of_motion, duration_s, expected)?;
        let intervals = match self.motion.ends {
            Ends::Periodic => count,
            Ends::AtRest | Ends::Prescribed => count - 1,
        };
        let expected = format!("motion.duration_s / {intervals} for this kind of ends");
        at.of("sample_interval_s").near(
            self.sample_interval_s,
            duration_s / intervals as f64,
            &expected,
        )
    }

    /// Checks that the diagnosis has values in range and printable text.
    fn validate_diagnosis(&self, at: &Field) -> Result<(), PlanError> {
        let Some(diagnosis) = &self.solve.diagnosis else { return Ok(()) };
        let infeasible = self.solve.status == Status::Infeasible;
        at.of("diagnosis").holds(infeasible, "given", "null unless status is infeasible")?;
        for (index, culprit) in diagnosis.culprits.iter().enumerate() {
            let at = at.item("diagnosis.culprits", index);
            let found = culprit.constraint;
            let constraint = !matches!(found.kind(), Kind::Cost | Kind::Check);
            at.of("constraint").holds(constraint, found, "the name of a constraint")?;
            // Both are also in the catalogue, for readers that have only the diagnosis.
            let (kind, unit) = (found.kind(), found.unit().symbol());
            let word = |kind: Kind| format!("{kind:?}").to_lowercase();
            let expected = format!("{}, the kind of {found}", word(kind));
            at.of("part").holds(culprit.part == kind, word(culprit.part), expected)?;
            let expected = format!("{unit}, the unit of {found}");
            at.of("unit").holds(culprit.unit == unit, culprit.unit.escape_debug(), expected)?;
            let [from_s, to_s] = culprit.time_s;
            let numbers = [culprit.worst, from_s, to_s, to_s - from_s, culprit.share];
            let given = [culprit.given.unwrap_or(0.0), culprit.would_do.unwrap_or(0.0)];
            let sound = numbers.iter().all(|number| number.is_finite() && *number >= 0.0)
                && given.iter().all(|number| number.is_finite());
            at.holds(
                sound,
                "out of range",
                "finite numbers of at least 0, with times in ascending order",
            )?;
            let words = [Some(&culprit.advice), culprit.subject.as_ref(), culprit.field.as_ref()];
            let plain = !words.into_iter().flatten().any(|text| text.contains(char::is_control));
            at.holds(plain, "a text with control characters", "text without control characters")?;
        }
        Ok(())
    }

    /// Checks that bounds and given times have values in range.
    fn validate_timing(&self, at: &Field) -> Result<(), PlanError> {
        let [least, most] = self.motion.timing.bounds;
        let ok = 0.0 < least && least <= 1.0 && 1.0 <= most && most.is_finite();
        let expected = "[least, most] with 0 < least <= 1 <= most";
        at.of("motion.timing.bounds").holds(ok, format!("[{least}, {most}]"), expected)?;
        let Some(timing) = &self.solve.timing else { return Ok(()) };
        let (at, feet) = (at.of("solve.timing"), self.robot.end_effectors.len());
        let given_s = timing.given_duration_s;
        let ok = given_s > 0.0 && given_s.is_finite();
        at.of("given_duration_s").holds(ok, given_s, "a time above 0 s")?;
        let rows = timing.given_stance.len();
        let ok = (MIN_SAMPLES..=MAX_SAMPLES).contains(&rows);
        let expected = format!("{MIN_SAMPLES} to {MAX_SAMPLES} samples");
        at.of("given_stance").holds(ok, format!("{rows} samples long"), expected)?;
        for (i, row) in timing.given_stance.iter().enumerate() {
            at.item("given_stance", i).length(row.len(), feet, "end effector")?;
        }
        let scores = timing.given.iter().chain([&timing.chosen]);
        let numbers: Vec<f64> = scores.flat_map(|score| [score.cost, score.as_played]).collect();
        at.finite(&numbers)
    }

    /// Checks that targets and height limits name existing subjects, and times of the motion.
    fn validate_choreography(&self, at: &Field) -> Result<(), PlanError> {
        let feet = self.robot.end_effectors.len();
        let duration_s = self.motion.duration_s;
        let known = |at: &Field, of: Subject| {
            let index = if let Subject::EndEffector(j) = of { j } else { 0 };
            let expected = format!("com, body, or an end effector below {feet}");
            at.of("of").holds(index < feet, format!("end effector {index}"), expected)
        };
        let in_motion = |at: &Field, time_s: f64| {
            let ok = (0.0..=duration_s + AGREEMENT).contains(&time_s);
            at.holds(ok, time_s, format!("a time from 0 to motion.duration_s, {duration_s}"))
        };
        for (index, target) in self.motion.targets.iter().enumerate() {
            let at = at.item("motion.targets", index);
            known(&at, target.of)?;
            in_motion(&at.of("at_s"), target.at_s)?;
            let numbers = target.position_m.iter().chain(&target.velocity_m_s);
            let numbers: Vec<f64> =
                numbers.chain([&target.heading_rad]).flatten().copied().collect();
            at.finite(&numbers)?;
        }
        for (index, limit) in self.motion.heights.iter().enumerate() {
            let at = at.item("motion.heights", index);
            known(&at, limit.of)?;
            in_motion(&at.of("from_s"), limit.from_s)?;
            in_motion(&at.of("to_s"), limit.to_s)?;
            let numbers: Vec<f64> = [limit.above_m, limit.below_m].into_iter().flatten().collect();
            at.finite(&numbers)?;
        }
        Ok(())
    }

    /// Checks lengths, finite values and rotations of one sample.
    fn validate_sample(&self, sample: &Sample, at: &Field) -> Result<(), PlanError> {
        at.of("time_s").finite(&[sample.time_s])?;
        at.of("base_position_m").finite(&sample.base_position_m)?;
        at.of("base_yaw_pitch_roll_rad").finite(&sample.base_yaw_pitch_roll_rad)?;
        at.of("base_orientation_wxyz").finite(&sample.base_orientation_wxyz)?;
        at.of("joint_rad").length(sample.joint_rad.len(), self.robot.joints.len(), "joint")?;
        at.of("joint_rad").finite(&sample.joint_rad)?;
        if !sample.joint_correction_rad.is_empty() {
            let (at, corrections) = (at.of("joint_correction_rad"), &sample.joint_correction_rad);
            at.length(corrections.len(), self.robot.joints.len(), "joint")?;
            at.finite(corrections)?;
        }
        let torques = &sample.joint_torque_nm;
        at.of("joint_torque_nm").length(torques.len(), self.robot.joints.len(), "joint")?;
        at.of("joint_torque_nm").finite(torques)?;
        at.of("com_m").finite(&sample.com_m)?;
        let feet = self.robot.end_effectors.len();
        at.of("end_effectors").length(sample.end_effectors.len(), feet, "end effector")?;
        for (j, (end_effector, foot)) in
            sample.end_effectors.iter().zip(&self.robot.end_effectors).enumerate()
        {
            let at = at.item("end_effectors", j);
            validate_end_effector(end_effector, &at)?;
            let (at, torque_nm) = (at.of("motor_torque_nm"), end_effector.motor_torque_nm);
            match foot.contact.actuator() {
                Some(_) => at.holds(
                    torque_nm.is_some(),
                    "null",
                    "the torque of the wheel's motor \
                    in N·m",
                )?,
                None => at.holds(
                    torque_nm.is_none(),
                    "a number",
                    "null, because this end effector \
                    has no motor",
                )?,
            }
            at.finite(torque_nm.as_slice())?;
        }

        let [w, x, y, z] = sample.base_orientation_wxyz;
        let quaternion = Quaternion::new(w, x, y, z);
        let unit = (quaternion.norm() - 1.0).abs() <= AGREEMENT;
        let at = at.of("base_orientation_wxyz");
        at.holds(unit, format!("of norm {}", quaternion.norm()), "a unit quaternion [w, x, y, z]")?;
        let [yaw, pitch, roll] = sample.base_yaw_pitch_roll_rad;
        let turned = UnitQuaternion::from_quaternion(quaternion)
            .angle_to(&Rotation3::from_euler_angles(roll, pitch, yaw).into());
        at.holds(
            turned <= AGREEMENT,
            format!("{turned:.3e} rad away from base_yaw_pitch_roll_rad"),
            "the same rotation, R_z(yaw) R_y(pitch) R_x(roll)",
        )
    }
}

fn validate_end_effector(end_effector: &EndEffectorSample, at: &Field) -> Result<(), PlanError> {
    at.of("position_m").finite(&end_effector.position_m)?;
    at.of("force_n").finite(&end_effector.force_n)?;
    at.of("wheel_speed_rad_s").finite(&[end_effector.wheel_speed_rad_s])?;
    at.of("motor_speed_rad_s").finite(&[end_effector.motor_speed_rad_s])?;
    at.of("tilt_rad").finite(&[end_effector.tilt_rad])?;
    at.of("yaw_rad").finite(&[end_effector.yaw_rad])
}

/// Path of a field in a plan file, for error messages.
struct Field<'a> {
    file: &'a str,
    path: String,
}

impl Field<'_> {
    fn of(&self, name: &str) -> Self {
        let dot = if self.path.is_empty() { "" } else { "." };
        Self { file: self.file, path: format!("{}{dot}{name}", self.path) }
    }

    fn item(&self, name: &str, index: usize) -> Self {
        self.of(&format!("{name}[{index}]"))
    }

    fn holds(
        &self,
        ok: bool,
        value: impl Display,
        expected: impl Display,
    ) -> Result<(), PlanError> {
        if ok {
            return Ok(());
        }
        let (value, expected) = (value.to_string(), expected.to_string());
        Err(JSON.fault(self.file, &self.path, &value, expected).into())
    }

    fn finite(&self, values: &[f64]) -> Result<(), PlanError> {
        let bad = values.iter().find(|value| !value.is_finite());
        self.holds(bad.is_none(), bad.copied().unwrap_or_default(), "finite numbers")
    }

    fn length(&self, found: usize, expected: usize, thing: &str) -> Result<(), PlanError> {
        self.holds(
            found == expected,
            format!("{found} long"),
            format!("one for each {thing} of the robot, {expected} in all"),
        )
    }

    fn near(&self, value: f64, expected: f64, meaning: &str) -> Result<(), PlanError> {
        let ok = (value - expected).abs() <= AGREEMENT;
        self.holds(ok, value, format!("{expected}, {meaning}"))
    }

    fn all_near(&self, found: &[f64], expected: &[f64], meaning: &str) -> Result<(), PlanError> {
        let ok = found.iter().zip(expected).all(|(a, b)| (a - b).abs() <= AGREEMENT);
        self.holds(ok, format!("{found:?}"), format!("{expected:?}, {meaning}"))
    }
}
