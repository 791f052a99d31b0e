//! Plans as JSON text: one writer, one reader, and what the reader says about a bad file.
//!
//! Every field with its unit and frame: `docs/plan-format.md`. The writer is deterministic: the same plan
//! gives the same bytes. Arrays of plain values stay on one line, so that a plan can be read and diffed.

use super::{FORMAT, Plan, VERSION};
use miette::Diagnostic;
use rollwalk_robot::InvalidRobot;
use serde::Deserialize;
use serde_json::error::Category;
use thiserror::Error;

/// Why a plan file cannot be used.
#[derive(Clone, Debug, PartialEq, Eq, Error, Diagnostic)]
pub enum PlanError {
    /// The text is not JSON, or a field is missing or of the wrong type.
    #[error("{file}:{line}:{column}: {}{message}", field(path))]
    #[diagnostic(help("docs/plan-format.md lists every field; `rollwalk plan` writes such files"))]
    Syntax {
        /// The file as the caller named it.
        file: String,
        /// Line of the trouble, from 1.
        line: usize,
        /// Column of the trouble, from 1.
        column: usize,
        /// JSON path of the field, such as `samples[3].com_m`; `.` is the whole file.
        path: String,
        /// What is wrong.
        message: String,
    },
    /// The robot breaks the rules of robot files.
    #[error("{file}: robot: {error}")]
    #[diagnostic(help("the same rules as for robot files: `rollwalk robot check`"))]
    Robot {
        /// The file as the caller named it.
        file: String,
        /// The broken rules.
        error: InvalidRobot,
    },
    /// A field has a value that no plan can have.
    #[error("{file}: {path} is {value}; expected {expected}")]
    #[diagnostic(help("docs/plan-format.md lists every field with its unit and frame"))]
    Value {
        /// The file as the caller named it.
        file: String,
        /// JSON path of the field.
        path: String,
        /// The value found.
        value: String,
        /// What would be right.
        expected: String,
    },
}

/// A field as the beginning of a message; nothing for the whole file.
fn field(path: &str) -> String {
    if path == "." { String::new() } else { format!("{path}: ") }
}

impl Plan {
    /// This plan as readable JSON, ending in a newline.
    pub fn to_json(&self) -> String {
        // Only maps with non-string keys can fail to become JSON; a plan has no map.
        let pretty = serde_json::to_string_pretty(self).unwrap_or_default();
        let mut text = join_plain_arrays(&pretty);
        text.push('\n');
        text
    }

    /// Reads a plan and checks that it is whole and consistent. `file` is how errors name the text.
    ///
    /// # Errors
    /// [`PlanError`] names file, field, value and what would be right.
    pub fn from_json(file: &str, text: &str) -> Result<Self, PlanError> {
        let syntax = |path: String, error: &serde_json::Error| PlanError::Syntax {
            file: file.to_owned(),
            line: error.line(),
            column: error.column(),
            path,
            message: match error.classify() {
                Category::Data => without_position(error),
                Category::Eof if text.trim().is_empty() => "the file is empty, no JSON".to_owned(),
                Category::Eof => "this is not whole JSON: the file ends too early".to_owned(),
                _ => format!("{}: {}", not_json(text, error), without_position(error)),
            },
        };
        // Format and version first: a plan of another version may differ in any other field.
        let header: Header =
            serde_json::from_str(text).map_err(|error| syntax(".".to_owned(), &error))?;
        header.check(file)?;
        let mut deserializer = serde_json::Deserializer::from_str(text);
        let plan: Self = serde_path_to_error::deserialize(&mut deserializer)
            .map_err(|error| syntax(error.path().to_string(), error.inner()))?;
        plan.validate(file)?;
        Ok(plan)
    }
}

/// The two fields that every version of the format has.
#[derive(Deserialize)]
struct Header {
    #[serde(default)]
    format: serde_json::Value,
    #[serde(default)]
    version: serde_json::Value,
}

impl Header {
    fn check(&self, file: &str) -> Result<(), PlanError> {
        let fault = |path: &str, value: &serde_json::Value, expected: String| PlanError::Value {
            file: file.to_owned(),
            path: path.to_owned(),
            value: if value.is_null() { "missing".to_owned() } else { value.to_string() },
            expected,
        };
        if self.format.as_str() != Some(FORMAT) {
            return Err(fault("format", &self.format, format!("\"{FORMAT}\"")));
        }
        match self.version.as_u64() {
            Some(version) if version == u64::from(VERSION) => Ok(()),
            Some(version) if version > u64::from(VERSION) => {
                let expected =
                    format!("{VERSION}: the plan is from a newer rollwalk, update this one");
                Err(fault("version", &self.version, expected))
            }
            Some(_) => {
                let expected = format!(
                    "{VERSION}: the plan is from an older rollwalk, plan the motion once more"
                );
                Err(fault("version", &self.version, expected))
            }
            None => Err(fault("version", &self.version, format!("{VERSION}"))),
        }
    }
}

/// What is wrong with the syntax: a number that JSON cannot have is likelier than anything else.
fn not_json(text: &str, error: &serde_json::Error) -> &'static str {
    let line = text.lines().nth(error.line().saturating_sub(1)).unwrap_or_default();
    // The reader may stop within the word.
    let before = error.column().saturating_sub(1 + "-Infinity".len());
    let near = line.as_bytes().get(before..).unwrap_or_default();
    let near = String::from_utf8_lossy(&near[..near.len().min(2 * "-Infinity".len())]);
    match ["NaN", "Infinity"].iter().any(|word| near.contains(word)) {
        true => "NaN and Infinity are no numbers in JSON",
        false => "this is not JSON",
    }
}

/// The message without serde_json's trailing position, which the error carries as fields.
fn without_position(error: &serde_json::Error) -> String {
    let message = error.to_string();
    message.rsplit_once(" at line ").map_or(message.clone(), |(head, _)| head.to_owned())
}

/// Puts every array that holds no array and no object on one line.
pub(crate) fn join_plain_arrays(pretty: &str) -> String {
    let mut out = String::with_capacity(pretty.len());
    let mut rest = pretty;
    while let Some(open) = find_outside_strings(rest, |c| c == '[') {
        let (head, tail) = rest.split_at(open);
        out.push_str(head);
        let inside = &tail[1..];
        let end = find_outside_strings(inside, |c| matches!(c, '[' | '{' | ']'));
        match end {
            Some(end) if inside[end..].starts_with(']') => {
                let items: Vec<&str> =
                    inside[..end].lines().map(str::trim).filter(|l| !l.is_empty()).collect();
                out.push('[');
                out.push_str(&items.join(" "));
                out.push(']');
                rest = &inside[end + 1..];
            }
            _ => {
                out.push('[');
                rest = inside;
            }
        }
    }
    out.push_str(rest);
    out
}

/// Byte offset of the first character outside JSON strings that `wanted` accepts.
fn find_outside_strings(text: &str, wanted: impl Fn(char) -> bool) -> Option<usize> {
    let mut in_string = false;
    let mut escaped = false;
    for (offset, c) in text.char_indices() {
        match c {
            _ if escaped => escaped = false,
            '\\' if in_string => escaped = true,
            '"' => in_string = !in_string,
            _ if !in_string && wanted(c) => return Some(offset),
            _ => {}
        }
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::families::{Family, Kind};
    use crate::motion::Ends;
    use crate::plan::{Culprit, Diagnosis, Sample, Status, Verdict};
    use crate::test_plans;

    /// The plan with one piece of its JSON replaced.
    fn tampered(from: &str, to: &str) -> PlanError {
        let text = test_plans::start_stop().to_json();
        assert!(text.contains(from), "the text to replace, {from}, is not there");
        Plan::from_json("x.json", &text.replacen(from, to, 1)).expect_err("a bad plan was accepted")
    }

    #[test]
    fn plans_survive_the_round_trip_to_the_last_bit_and_byte() {
        for plan in [test_plans::start_stop(), test_plans::cruise(), test_plans::cruise_middle()] {
            let text = plan.to_json();
            let read = Plan::from_json("x.json", &text).expect("own output is valid");
            assert_eq!(read, plan);
            assert_eq!(read.to_json(), text);
        }
    }

    #[test]
    fn plain_arrays_stay_on_one_line_and_strings_are_left_alone() {
        let mut plan = test_plans::start_stop();
        plan.motion.name = "a \"b\" [1, 2] {c} \\".to_owned();
        let text = plan.to_json();
        assert!(text.contains("\"stance\": [\n      [true, true, true, true],\n"), "{text}");
        let read = Plan::from_json("x.json", &text).expect("still JSON");
        assert_eq!(read.motion.name, plan.motion.name);
    }

    #[test]
    fn errors_name_file_field_value_and_what_would_be_right() {
        let cases = [
            (
                "\"rollwalk-plan\"",
                "\"urdf\"",
                "x.json: format is \"urdf\"; expected \"rollwalk-plan\"",
            ),
            (
                "\"version\": 3",
                "\"version\": 7",
                "x.json: version is 7; expected 3: the plan is from a newer",
            ),
            (
                "\"version\": 3",
                "\"version\": 2",
                "x.json: version is 2; expected 3: the plan is from an older rollwalk, plan",
            ),
            ("\"version\": 3,", "", "x.json: version is missing; expected 3"),
            (
                "\"clearance_m\": 0.02",
                "\"clearance_m\": 0.01",
                "formulation: clearance_m is 0.01; expected 0.02, as this program",
            ),
            ("\"samples\": [", "\"samples\": [ 5,", "samples[0]: invalid type: integer `5`"),
            (
                "base_orientation_wxyz\": [1.0, 0.0, 0.0, 0.0]",
                "base_orientation_wxyz\": [1.0, 0.1, 0.0, 0.0]",
                "samples[0].base_orientation_wxyz is of norm 1.00",
            ),
            (
                "base_orientation_wxyz\": [1.0, 0.0, 0.0, 0.0]",
                "base_orientation_wxyz\": [0.0, 1.0, 0.0, 0.0]",
                "rad away from base_yaw_pitch_roll_rad; expected the same rotation",
            ),
            (
                "\"joint_rad\": [0.3, ",
                "\"joint_rad\": [",
                "samples[0].joint_rad is 3 long; expected one per joint of the robot, 4",
            ),
            (
                "\"joint_torque_nm\": [",
                "\"joint_torque_nm\": [0.0, ",
                "samples[0].joint_torque_nm is 5 long; expected one per joint of the robot, 4",
            ),
            (
                "\"motor_torque_nm\": ",
                "\"motor_torque_nm\": null, \"old\": ",
                "samples[0].end_effectors[0].motor_torque_nm is null; expected the torque of its",
            ),
            ("\"joint_torque_nm\": ", "\"old\": ", "samples[0]: missing field `joint_torque_nm`"),
            (
                "\"time_s\": 0.05,",
                "\"time_s\": 0.04,",
                "samples[1].time_s is 0.04; expected 0.05, the index",
            ),
            (
                "\"contact\": true",
                "\"contact\": false",
                "samples[0].end_effectors[0].contact is false; expected motion.stance[0][0], true",
            ),
            (
                "\"duration_s\": 2.0",
                "\"duration_s\": 0.0",
                "motion.duration_s is 0; expected a positive time",
            ),
            (
                "\"duration_s\": 2.0",
                "\"duration_s\": 2.5",
                "sample_interval_s is 0.05; expected 0.0625",
            ),
            (
                "      [true, true, true, true],\n",
                "",
                "motion.stance is 40 rows long; expected one row per sample, 41",
            ),
            ("\"parent\": 0", "\"parent\": 9", "x.json: robot: robot `box` is not valid"),
        ];
        for (from, to, expected) in cases {
            let message = tampered(from, to).to_string();
            assert!(message.contains(expected), "{from} -> {to}:\n{message}\n{expected}");
            assert!(message.starts_with("x.json"), "{message}");
        }
    }

    #[test]
    fn what_is_not_json_is_located() {
        let error = Plan::from_json("x.json", "{\n  \"format\": ,").expect_err("not JSON");
        assert!(matches!(error, PlanError::Syntax { line: 2, column: 13, .. }), "{error}");
        let whole = test_plans::start_stop().to_json();
        let error = Plan::from_json("x.json", &whole[..whole.len() / 2]).expect_err("half a plan");
        assert!(error.to_string().contains("the file ends too early"), "{error}");
        // A number too large for a float is not silently infinite.
        assert!(
            tampered("\"energy\": 0.0", "\"energy\": 1e999").to_string().contains("out of range")
        );
        for number in ["NaN", "Infinity", "-Infinity", "null"] {
            let error = tampered("\"energy\": 0.0", &format!("\"energy\": {number}"));
            assert!(matches!(error, PlanError::Syntax { .. }), "{error}");
            let expected =
                if number == "null" { "invalid type: null" } else { "are no numbers in JSON" };
            assert!(error.to_string().contains(expected), "{error}");
        }
    }

    #[test]
    fn states_outside_the_motion_agree_with_its_kind_of_ends() {
        let refused = |plan: &Plan| plan.validate("x.json").expect_err("a change").to_string();
        let everywhere: [fn(&mut Sample); 10] = [
            |state| state.time_s += 1e-5,
            |state| state.base_position_m[1] += 1e-5,
            |state| state.com_m[0] += 1e-5,
            |state| state.joint_rad[2] += 1e-5,
            |state| state.end_effectors[1].contact = false,
            |state| state.end_effectors[3].position_m[2] += 1e-5,
            |state| state.end_effectors[1].tilt_rad += 1e-5,
            |state| state.end_effectors[2].yaw_rad += 1e-5,
            |state| state.joint_torque_nm[0] += 1e-5,
            |state| *state.end_effectors[3].motor_torque_nm.as_mut().expect("a motor") += 1e-5,
        ];
        let of_copies: fn(&mut Sample) = |state| state.end_effectors[0].force_n[1] += 1e-5;
        let plans = [test_plans::start_stop(), test_plans::cruise(), test_plans::cruise_middle()];
        for plan in plans {
            plan.validate("x.json").expect("a plan");
            let copied = plan.motion.ends != Ends::Prescribed;
            let changes = everywhere.into_iter().chain(copied.then_some(of_copies));
            for (index, change) in changes.enumerate() {
                for end in ["before", "after"] {
                    let mut changed = plan.clone();
                    change(if end == "after" { &mut changed.after } else { &mut changed.before });
                    let message = refused(&changed);
                    assert!(message.starts_with(&format!("x.json: {end}.")), "{index}: {message}");
                }
            }
        }

        let mut speeds = test_plans::cruise();
        speeds.after.end_effectors[0].wheel_speed_rad_s += 1e-5;
        assert!(refused(&speeds).contains("after.end_effectors[0].wheel_speed_rad_s is"));
        let mut speeds = test_plans::cruise();
        speeds.before.end_effectors[0].motor_speed_rad_s += 1e-5;
        assert!(refused(&speeds).contains("before.end_effectors[0].motor_speed_rad_s is"));
    }

    #[test]
    fn a_diagnosis_repeats_the_catalogue_and_says_nothing_else() {
        let mut plan = test_plans::start_stop();
        plan.solve.status = Status::Infeasible;
        let slip = Culprit {
            constraint: Family::Slip,
            part: Kind::Build,
            subject: None,
            time_s: [0.0, 1.0],
            worst: 0.1,
            unit: "m/s".to_owned(),
            share: 1.0,
            field: None,
            given: None,
            would_do: None,
            advice: "steps".to_owned(),
        };
        let with = |culprit: Culprit| {
            let diagnosis = Diagnosis { verdict: Verdict::Stuck, culprits: vec![culprit] };
            let mut plan = plan.clone();
            plan.solve.diagnosis = Some(diagnosis);
            Plan::from_json("x.json", &plan.to_json()).map_err(|error| error.to_string())
        };
        with(slip.clone()).expect("a plan");
        for (culprit, expected) in [
            (
                Culprit { part: Kind::Request, ..slip.clone() },
                "culprits[0].part is request; expected build, the kind of slip",
            ),
            (
                Culprit { unit: "mm/s".to_owned(), ..slip.clone() },
                "culprits[0].unit is mm/s; expected m/s, the unit of slip",
            ),
            (Culprit { constraint: Family::Posture, ..slip.clone() }, "the name of a constraint"),
            (Culprit { share: -1.0, ..slip.clone() }, "none of them negative"),
            (Culprit { advice: "\u{1b}[2J".to_owned(), ..slip.clone() }, "control characters"),
        ] {
            let message = with(culprit).expect_err("another diagnosis");
            assert!(message.contains(expected), "{message}");
        }
    }

    #[test]
    fn the_placement_of_the_end_is_that_of_the_last_state() {
        for (plan, field) in [
            (test_plans::cruise(), "before.base_position_m is [-0.02"),
            (test_plans::cruise_middle(), "samples[12].base_position_m is [0.3"),
        ] {
            let mut turned = plan;
            turned.end_placement.yaw_rad = 0.1;
            let message = turned.validate("x.json").expect_err("no such turn").to_string();
            assert!(message.contains(field), "{message}");
            assert!(message.contains("end_placement"), "{message}");
        }
    }
}
