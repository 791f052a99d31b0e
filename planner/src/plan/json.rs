//! Plans as JSON text: one writer and one reader.
//!
//! `docs/formats/plan-format.md` lists every field with its unit and frame. The writer is deterministic: equal plans give equal
//! bytes. Arrays of plain values stay on one line, so that plans can be read and diffed.

use super::{FORMAT, Plan, VERSION};
use crate::json::{Format, JsonError};
use crate::motion::MotionTerrain;
use miette::Diagnostic;
use rollwalk_multibody::ground::file as terrain_file;
use rollwalk_robot::InvalidRobot;
use thiserror::Error;

/// Format of plan files.
pub(super) const JSON: Format = Format {
    name: FORMAT,
    version: VERSION,
    what: "plan",
    make_again: "plan the motion again",
    help: "write plans with `rollwalk plan`; docs/formats/plan-format.md lists every field with \
        its unit and frame",
};

/// Reason why a plan file is refused.
#[derive(Clone, Debug, PartialEq, Eq, Error, Diagnostic)]
pub enum PlanError {
    /// The text is not a plan, or a field has an impossible value.
    #[error(transparent)]
    #[diagnostic(transparent)]
    Json(#[from] JsonError),
    /// The terrain breaks the rules of terrain files.
    #[error("{file}: motion.terrain: {faults}")]
    #[diagnostic(help("correct the terrain file, and plan the motion again"))]
    Terrain {
        /// Name of the file, as passed by the caller.
        file: String,
        /// Faults of the terrain.
        faults: String,
    },
    /// The robot breaks the rules of robot files.
    #[error("{file}: robot: {error}")]
    #[diagnostic(help(
        "correct the robot file, check this file with `rollwalk robot check`, and plan the motion \
        again"
    ))]
    Robot {
        /// Name of the file, as passed by the caller.
        file: String,
        /// Rules that the robot breaks.
        error: InvalidRobot,
    },
}

impl Plan {
    /// Returns the plan as readable JSON, ending in a newline.
    pub fn to_json(&self) -> String {
        // Only maps with non-string keys can fail to become JSON; a plan has no map.
        let pretty = serde_json::to_string_pretty(self).unwrap_or_default();
        let mut text = join_plain_arrays(&pretty);
        text.push('\n');
        text
    }

    /// Reads a plan and checks that it is complete and consistent. Errors name the text by `file`.
    ///
    /// # Errors
    /// Returns an error if the text is not a valid plan. [`PlanError`] names file, field, value and the valid range.
    pub fn from_json(file: &str, text: &str) -> Result<Self, PlanError> {
        let mut plan: Self = JSON.read(file, text)?;
        plan.validate(file)?;
        if let Some(MotionTerrain { toml, margins }) = plan.motion.terrain.clone() {
            let terrain =
                terrain_file::from_toml("motion.terrain.toml", &toml).map_err(|error| {
                    PlanError::Terrain { file: file.to_owned(), faults: error.to_string() }
                })?;
            plan.motion.set_terrain(terrain, margins, &plan.robot);
        }
        Ok(plan)
    }
}

/// Joins the lines of every array without nested arrays or objects.
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
    use crate::motion::{Ends, HeightLimit, Subject, Target};
    use crate::plan::{Culprit, Diagnosis, Refinement, Sample, Status, Verdict};
    use crate::test_plans;
    use rollwalk_protocol::actuators::bus::Bus;
    use serde_json::{Value, json};

    /// Error of a plan after one piece of its JSON is replaced.
    fn tampered(from: &str, to: &str) -> PlanError {
        let text = test_plans::start_stop().to_json();
        assert!(text.contains(from), "the text to replace, {from}, is not there");
        Plan::from_json("x.json", &text.replacen(from, to, 1)).expect_err("a bad plan was accepted")
    }

    fn slip() -> Culprit {
        Culprit {
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
        }
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
                "x.json: version is 7; expected 3: update rollwalk, because a newer",
            ),
            (
                "\"version\": 3",
                "\"version\": 2",
                "x.json: version is 2; expected 3: plan the motion again, because an older version",
            ),
            ("\"version\": 3,", "", "x.json: version is missing; expected 3"),
            (
                "\"clearance_m\": 0.02",
                "\"clearance_m\": 0.01",
                "formulation: clearance_m is 0.01; expected 0.02, the value in this version",
            ),
            ("\"samples\": [", "\"samples\": [ 5,", "samples[0] is 5; expected an object"),
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
                "samples[0].joint_rad is 3 long; expected one for each joint of the robot, 4",
            ),
            (
                "\"joint_torque_nm\": [",
                "\"joint_torque_nm\": [0.0, ",
                "samples[0].joint_torque_nm is 5 long; expected one for each joint of the robot, 4",
            ),
            (
                "\"joint_torque_nm\": ",
                "\"joint_torques_nm\": ",
                "samples[0]: unknown field `joint_torques_nm`; did you mean `joint_torque_nm`?",
            ),
            (
                "\"format\"",
                "\"comment\": 0, \"format\"",
                "unknown field `comment`; valid names: `format`",
            ),
            (
                "\"time_s\": 0.05,",
                "\"time_s\": 0.04,",
                "samples[1].time_s is 0.04; expected 0.05, the index",
            ),
            (
                "\"contact\": true",
                "\"contact\": false",
                "samples[0].end_effectors[0].contact is false; expected true, as in motion.stance[0][0]",
            ),
            (
                "\"duration_s\": 2.0",
                "\"duration_s\": 0.0",
                "motion.duration_s is 0; expected a time above 0 s",
            ),
            (
                "\"duration_s\": 2.0",
                "\"duration_s\": 1e5",
                "motion.duration_s is 100000; expected a time above 0 s and at most",
            ),
            (
                "\"duration_s\": 2.0",
                "\"duration_s\": 2.5",
                "sample_interval_s is 0.05; expected 0.0625",
            ),
            (
                "      [true, true, true, true],\n",
                "",
                "motion.stance is 40 rows long; expected one row for each of the 41 samples",
            ),
            ("\"parent\": 0", "\"parent\": 9", "x.json: robot: robot `box` is not valid"),
        ];
        for (from, to, expected) in cases {
            let message = tampered(from, to).to_string();
            assert!(message.contains(expected), "{from} -> {to}:\n{message}\n{expected}");
            assert!(message.starts_with("x.json"), "{message}");
        }
    }

    /// Collects the JSON pointers of all objects and values of a plan. Lists are represented by their first item.
    fn collect_pointers(value: &Value, path: &str, found: &mut Vec<String>) {
        found.push(path.to_owned());
        match value {
            Value::Object(fields) => {
                fields.iter().for_each(|(key, value)| {
                    collect_pointers(value, &format!("{path}/{key}"), found)
                });
            }
            Value::Array(items) => {
                items
                    .iter()
                    .take(1)
                    .for_each(|value| collect_pointers(value, &format!("{path}/0"), found));
            }
            _ => {}
        }
    }

    #[test]
    fn no_field_is_unknown_and_no_error_speaks_rust() {
        let mut plan = test_plans::start_stop();
        plan.solve.status = Status::Infeasible;
        plan.solve.diagnosis = Some(Diagnosis { verdict: Verdict::Stuck, culprits: vec![slip()] });
        plan.solve.refinements = vec![Refinement {
            samples: 20,
            residual: Family::Slip,
            worst: 0.1,
            tolerance: 0.05,
            unit: "m/s".to_owned(),
        }];
        plan.motion.targets = vec![Target {
            of: Subject::EndEffector(1),
            at_s: 0.5,
            position_m: [None, None, Some(0.0)],
            velocity_m_s: [None; 3],
            heading_rad: None,
        }];
        let limit = HeightLimit {
            of: Subject::Com,
            from_s: 0.0,
            to_s: 1.0,
            above_m: Some(0.1),
            below_m: None,
        };
        plan.motion.heights = vec![limit];
        plan.robot.buses.insert(0, Bus::default());
        let whole = serde_json::to_value(&plan).expect("a plan becomes JSON");
        let read = |changed: &Value| Plan::from_json("x.json", &changed.to_string());
        read(&whole).expect("a plan");
        let mut all = Vec::new();
        collect_pointers(&whole, "", &mut all);
        let rust = [
            "f64",
            "u8",
            "u32",
            "u64",
            "usize",
            "struct",
            "enum",
            "sequence",
            "map",
            "tuple",
            "variant",
            "unit value",
            "identifier",
            "invalid",
            "borrowed",
            "integer `",
            "Option",
        ];
        for path in all {
            let mut changed = whole.clone();
            let place = changed.pointer_mut(&path).expect("it is there");
            // Keys of buses are numbers; the subject of a target is a word or an object with a single field.
            let own_keys = ["/of", "/buses"].iter().any(|end| path.ends_with(end));
            if let Some(fields) = place.as_object_mut().filter(|_| !own_keys) {
                fields.insert("shoe_size".to_owned(), 43.into());
                let message = read(&changed).expect_err(&path).to_string();
                assert!(message.contains("shoe_size"), "{path}: {message}");
            }
            for value in
                [json!({}), json!([]), json!("x"), json!(-1), json!(0.5), json!(null), json!(true)]
            {
                let mut changed = whole.clone();
                *changed.pointer_mut(&path).expect("it is there") = value.clone();
                let Err(error) = read(&changed) else { continue };
                let message = error.to_string();
                let word = rust.iter().find(|word| message.contains(*word));
                assert_eq!(word, None, "{path} = {value}: {message}");
            }
        }
    }

    #[test]
    fn every_motor_has_a_torque() {
        let mut plan = test_plans::start_stop();
        plan.samples[0].end_effectors[0].motor_torque_nm = None;
        let message = plan.validate("x.json").expect_err("no torque").to_string();
        let expected = "samples[0].end_effectors[0].motor_torque_nm is null; expected the torque of the wheel's motor";
        assert!(message.contains(expected), "{message}");
    }

    #[test]
    fn what_is_not_json_is_located() {
        let error = Plan::from_json("x.json", "{\n  \"format\": ,").expect_err("not JSON");
        assert!(error.to_string().starts_with("x.json:2:13: "), "{error}");
        let whole = test_plans::start_stop().to_json();
        let error = Plan::from_json("x.json", &whole[..whole.len() / 2]).expect_err("half a plan");
        assert!(error.to_string().contains("the file ends too early"), "{error}");
        // A number too large for a float is not silently infinite.
        assert!(
            tampered("\"energy\": 0.0", "\"energy\": 1e999")
                .to_string()
                .contains("solve.energy is out of range")
        );
        for number in ["NaN", "Infinity", "-Infinity", "null"] {
            let error = tampered("\"energy\": 0.0", &format!("\"energy\": {number}"));
            let expected = match number {
                "null" => "solve.energy is null; expected a number",
                _ => "are not numbers in JSON",
            };
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
        let slip = slip();
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
            (Culprit { share: -1.0, ..slip.clone() }, "finite numbers of at least 0"),
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
