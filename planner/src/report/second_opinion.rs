//! Comparison of the report with `docs/formats/check_plan.py`. The script computes the same equations in another language and
//! with other kinematics, and shares no code with the report.

use super::{Grid, Judgement, Report};
use crate::families::{Family, Kind};
use crate::motion::{Ends, Motion};
use crate::plan::{Plan, Sample};
use crate::{optimise, test_plans, test_robots};
use rollwalk_robot::{Actuator, Contact, JointSpring, Robot, RollingDrag, TorqueSpeedLine};
use serde_json::Value;
use std::io::Write;
use std::ops::ControlFlow;
use std::process::{Command, Stdio};

const SCRIPT: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../docs/formats/check_plan.py");

fn python() -> Command {
    let mut python = Command::new("python3");
    python.args([SCRIPT, "--json"]).stdout(Stdio::piped()).stderr(Stdio::piped());
    python
}

/// Runs the script on a plan, and returns its exit code and table.
fn check_plan(plan: &Plan) -> (Option<i32>, Value) {
    let mut child =
        python().arg("/dev/stdin").stdin(Stdio::piped()).spawn().expect(
            "python3 runs docs/formats/check_plan.py; on Debian: apt-get install -y python3",
        );
    let mut input = child.stdin.take().expect("piped");
    input.write_all(plan.to_json().as_bytes()).expect("the script reads");
    drop(input);
    let output = child.wait_with_output().expect("the script ends");
    let table = serde_json::from_slice(&output.stdout).unwrap_or(Value::Null);
    (output.status.code(), table)
}

/// Checks the plan of a robot that stands up from its body.
#[test]
fn a_plan_that_lies_passes_both_checks() {
    let text = include_str!("../../../shipped/robots/anymal_wheels.toml");
    let robot = Robot::from_toml("anymal_wheels.toml", text).expect("it ships");
    let text = include_str!("../../../shipped/motions/anymal_stand_up.toml");
    let motion = Motion::from_toml("stand_up.toml", text, &robot).expect("it ships");
    let go_on = &mut |_: &_| ControlFlow::Continue(());
    let plan = optimise(&robot, &motion, &crate::Options::default(), go_on);
    let (code, table) = check_plan(&plan);
    assert_eq!(code, Some(0), "{table:#}");
    assert!(Report::new(&plan).judgement.is_good());
}

/// Visits every number of a document with its path.
fn visit_numbers(value: &mut Value, path: &str, visit: &mut dyn FnMut(&str, &mut Value)) {
    match value {
        Value::Object(fields) => {
            for (key, field) in fields {
                let dot = if path.is_empty() { "" } else { "." };
                visit_numbers(field, &format!("{path}{dot}{key}"), visit);
            }
        }
        Value::Array(items) => {
            for (index, item) in items.iter_mut().enumerate() {
                visit_numbers(item, &format!("{path}[{index}]"), visit);
            }
        }
        Value::Number(_) => visit(path, value),
        _ => {}
    }
}

/// Returns the paths of a plan's numeric fields. Each list is represented by its final item, with all its contents.
fn numeric_fields(document: &mut Value) -> Vec<String> {
    let mut of_field = std::collections::BTreeMap::new();
    visit_numbers(document, "", &mut |path, _| {
        let field: String = path.chars().filter(|c| !c.is_ascii_digit()).collect();
        of_field.insert(field, path.to_owned());
    });
    of_field.into_values().filter(|path| path != "version").collect()
}

/// Returns true if a plan may contain null in a field that otherwise contains numbers.
fn is_optional(field: &str) -> bool {
    let keys = ["forward_m", "left_m", "turn_rad", "heading_rad", "below_m", "above_m", "level"];
    keys.iter().any(|key| field.ends_with(&format!(".{key}"))) || field.contains(".targets[")
}

#[test]
fn a_number_that_is_none_is_refused_wherever_it_stands() {
    let plan = of_every_kind();
    let mut document = serde_json::to_value(&plan).expect("a plan is JSON");
    let fields = numeric_fields(&mut document);
    assert!(fields.len() > 60, "{fields:?}");
    let folder = std::env::temp_dir().join(format!("rollwalk-strange-{}", std::process::id()));
    std::fs::create_dir_all(&folder).expect("a folder for tests");
    let mut script = python();
    let numbers = ["NaN", "Infinity", "-Infinity", "1e999"].into_iter().cycle();
    // Other writers write null for NaN. The fields exclude those in which null means that a goal, limit or level is missing.
    let nulls = fields.iter().filter(|field| !is_optional(field)).map(|field| (field, "null"));
    let cases: Vec<_> = fields.iter().zip(numbers).chain(nulls).collect();
    assert!(cases.len() > 2 * fields.len() - 15, "{cases:?}");
    for (index, (field, number)) in cases.iter().enumerate() {
        let mut changed = document.clone();
        visit_numbers(&mut changed, "", &mut |path, value| {
            if path == *field {
                *value = "strange".into();
            }
        });
        let text = changed.to_string().replacen("\"strange\"", number, 1);
        assert!(Plan::from_json("plan.json", &text).is_err(), "{field} = {number}");
        let file = folder.join(format!("{index}.json"));
        std::fs::write(&file, text).expect("the folder is ours");
        script.arg(file);
    }
    let output = script.output().expect("python3 runs");
    std::fs::remove_dir_all(&folder).expect("the folder is ours");
    assert_eq!((output.status.code(), output.stdout.len()), (Some(2), 0), "none is a plan");
    let errors = String::from_utf8_lossy(&output.stderr);
    for (index, (field, _)) in cases.iter().enumerate() {
        let named = errors.lines().any(|line| {
            line.contains(&format!("{index}.json: ")) && line.contains(&format!("{field} is "))
        });
        assert!(named, "{field} is not named in\n{errors}");
    }
}

/// Residual family that the script must report, and an edit of a state outside the motion that violates this family.
type Change = (&'static str, fn(&mut Sample));

#[test]
#[ignore = "minutes: cargo xtask nightly --only long"]
fn what_changes_outside_the_motion_is_noticed() {
    let everywhere: [Change; 11] = [
        ("time", |state| state.time_s += 0.001),
        ("ends", |state| state.base_position_m[0] += 0.002),
        ("ends", |state| state.joint_rad[1] += 0.01),
        ("ends", |state| state.base_yaw_pitch_roll_rad[2] += 0.001),
        ("ends", |state| state.com_m[1] += 0.0005),
        ("contact flag", |state| state.end_effectors[0].contact = false),
        ("ends", |state| state.end_effectors[2].position_m[2] += 0.002),
        ("ends", |state| state.end_effectors[1].tilt_rad += 0.001),
        ("ends", |state| state.end_effectors[3].yaw_rad += 0.001),
        ("ends", |state| state.joint_torque_nm[3] += 0.001),
        ("ends", |state| {
            *state.end_effectors[2].motor_torque_nm.as_mut().expect("a motor") += 0.001;
        }),
    ];
    let of_copies: Change = ("ends", |state| state.end_effectors[1].force_n[0] += 0.001);
    let noticed = |plan: &Plan, family: &str| {
        let (code, table) = check_plan(plan);
        let number = |field: &str| table[family][field].as_f64();
        assert_eq!(code, Some(1), "{table:#}");
        assert!(number("worst") > number("level"), "{family}: {table:#}");
    };
    let plans = [test_plans::start_stop(), test_plans::cruise(), test_plans::cruise_middle()];
    for (index, plan) in plans.into_iter().enumerate() {
        assert_eq!(check_plan(&plan).0, Some(0), "{}", check_plan(&plan).1);
        let copied = plan.motion.ends != Ends::Prescribed;
        let changes = everywhere.into_iter().chain(copied.then_some(of_copies));
        for (k, (family, change)) in changes.enumerate() {
            // Each change is before one plan and after another, because a run of the script takes a second.
            let mut changed = plan.clone();
            let is_after = (k + index) % 2 == 0;
            change(if is_after { &mut changed.after } else { &mut changed.before });
            noticed(&changed, family);
        }
    }
    let mut speeds = test_plans::cruise();
    speeds.after.end_effectors[0].wheel_speed_rad_s += 0.001;
    noticed(&speeds, "ends");
    let mut speeds = test_plans::cruise();
    speeds.before.end_effectors[0].motor_speed_rad_s += 0.001;
    noticed(&speeds, "ends");
    let mut moved = test_plans::cruise_middle();
    moved.end_placement.offset_m[1] += 0.001;
    noticed(&moved, "ends");
    let mut turned = test_plans::cruise_middle();
    turned.end_placement.yaw_rad = 0.001;
    noticed(&turned, "ends");
}

#[test]
fn the_script_names_a_residual_for_which_the_plan_has_no_level() {
    let expected = "formulation.families has no 'friction'";
    refuses("no-level", expected, |document| {
        let families = document["formulation"]["families"].as_array_mut().expect("a list");
        families.retain(|family| family["name"] != "friction");
    });
}

#[test]
fn the_script_refuses_lists_of_other_lengths() {
    let lists = [
        ("/motion/stance", "motion.stance has 23 elements; expected 24"),
        ("/motion/stance/2", "motion.stance[2] has 3 elements; expected 4"),
        ("/motion/held_wheels", "motion.held_wheels has 3 elements; expected 4"),
        ("/before/end_effectors", "before.end_effectors has 3 elements; expected 4"),
        ("/after/joint_rad", "after.joint_rad has 3 elements; expected 4"),
        ("/samples/5/joint_rad", "samples[5].joint_rad has 3 elements; expected 4"),
        ("/samples/9/joint_torque_nm", "samples[9].joint_torque_nm has 3 elements; expected 4"),
    ];
    for (index, (list, expected)) in lists.into_iter().enumerate() {
        refuses(&format!("short-{index}"), expected, |document| {
            document.pointer_mut(list).and_then(Value::as_array_mut).expect("a list").pop();
        });
    }
}

#[test]
fn the_script_refuses_torques_of_motors_that_are_none() {
    let motor = "/samples/3/end_effectors/1/motor_torque_nm";
    let welded = serde_json::json!({ "kind": "welded_wheel", "axis_in_link": [0.0, 1.0, 0.0] });
    let cases = [
        (motor, Value::Null, "motor_torque_nm is null; expected the torque of its motor"),
        (motor, "much".into(), "motor_torque_nm is \"much\"; expected the torque"),
        ("/robot/end_effectors/1/contact", welded, "; expected null: it has no motor"),
    ];
    for (index, (field, value, expected)) in cases.into_iter().enumerate() {
        refuses(&format!("motor-{index}"), expected, |document| {
            *document.pointer_mut(field).expect("a field") = value;
        });
    }
}

/// Checks that the script refuses a changed plan with a message that contains `expected`.
fn refuses(name: &str, expected: &str, change: impl FnOnce(&mut Value)) {
    let mut document = serde_json::to_value(test_plans::cruise()).expect("a plan is JSON");
    change(&mut document);
    let file = std::env::temp_dir().join(format!("rollwalk-{name}-{}.json", std::process::id()));
    std::fs::write(&file, document.to_string()).expect("a folder for tests");
    let output = python().arg(&file).output().expect("python3 runs");
    std::fs::remove_file(&file).expect("the file is ours");
    let errors = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(2), "{errors}");
    assert!(errors.contains(expected), "{errors}");
}

/// Changes every number of a plan slightly, so that no residual is 0.
fn shaken(mut plan: Plan) -> Plan {
    let mut random = test_robots::uniform(5);
    let mut shake = |value: &mut f64, by: f64| *value += by * random();
    let mut shake_sample = |s: &mut Sample| {
        s.com_m.iter_mut().for_each(|v| shake(v, 1e-3));
        s.joint_rad.iter_mut().for_each(|v| shake(v, 0.3));
        for e in &mut s.end_effectors {
            e.position_m.iter_mut().for_each(|v| shake(v, 1e-3));
            e.force_n.iter_mut().for_each(|v| shake(v, 30.0));
            shake(&mut e.tilt_rad, 0.1);
            shake(&mut e.yaw_rad, 0.1);
            shake(&mut e.wheel_speed_rad_s, 3.0);
            shake(&mut e.motor_speed_rad_s, 30.0);
        }
    };
    plan.samples.iter_mut().for_each(&mut shake_sample);
    shake_sample(&mut plan.before);
    shake_sample(&mut plan.after);
    plan
}

fn planned(robot: &str, motion: &str) -> Plan {
    let robot = Robot::from_toml("robot", robot).expect("a shipped robot");
    let motion = Motion::from_toml("motion", motion, &robot).expect("a shipped motion");
    optimise(&robot, &motion, &Default::default(), &mut |_| ControlFlow::Continue(()))
}

fn walk() -> Plan {
    planned(
        include_str!("../../../shipped/robots/agilebot.toml"),
        include_str!("../../../shipped/motions/walk.toml"),
    )
}

/// Plan with one wheel of every kind, and with motors that are too weak.
fn of_every_kind() -> Plan {
    let mut plan = test_plans::cruise();
    let line = TorqueSpeedLine { stall_torque_nm: 0.8, no_load_speed_rad_s: 7.0 };
    let weak = |motor: &mut Actuator| {
        (motor.torque_max_nm, motor.torque_speed) = (0.5, Some(line));
    };
    plan.robot.joints.iter_mut().for_each(|joint| weak(&mut joint.actuator));
    let drag = RollingDrag { rolling_resistance: 0.02, rolling_drag_s_m: 0.1 };
    let axis_in_link = nalgebra::Vector3::y();
    let ends = &mut plan.robot.end_effectors;
    ends[1].contact = Contact::WeldedWheel { axis_in_link };
    ends[2].contact = Contact::Skate { axis_in_link, blade_length_m: 0.02, drag };
    ends[3].contact = Contact::PassiveWheel { axis_in_link, drag };
    for (flags, sample) in plan.motion.stance.iter_mut().zip(&mut plan.samples).skip(6).take(5) {
        flags[3] = false;
        sample.end_effectors[3].contact = false;
    }
    weak(ends[0].contact.actuator_mut().expect("a driven wheel"));
    // Choreography at and between samples, including the half intervals at the ends.
    plan.motion.targets = test_robots::targets();
    plan.motion.heights = test_robots::heights();
    crate::torque::write(&mut plan);
    plan
}

#[test]
fn an_optimised_walk_passes_both_opinions() {
    let plan = walk();
    let report = Report::new(&plan);
    assert!(report.judgement == Judgement::Consistent, "{report}");
    let (code, table) = check_plan(&plan);
    assert_eq!(code, Some(0), "{table:#}");
}

#[test]
fn both_opinions_agree_on_the_size_of_every_residual() {
    let mut on_feet = test_plans::start_stop();
    on_feet.robot.end_effectors.iter_mut().for_each(|e| e.contact = Contact::PointFoot);
    let toe = &mut on_feet.robot.joints[2];
    toe.actuator = Actuator::none();
    toe.spring = Some(JointSpring { stiffness_nm_rad: 4.0, rest_rad: 0.1, damping_nm_s_rad: 0.2 });
    on_feet.formulation.has_passive_joints = true;
    crate::torque::write(&mut on_feet);
    let mut low = walk();
    low.samples.iter_mut().for_each(|sample| sample.base_position_m[2] -= 0.2);
    let plans = [
        walk(),
        low,
        test_plans::start_stop(),
        test_plans::cruise_middle(),
        of_every_kind(),
        on_feet,
    ];
    let mut seen = std::collections::BTreeSet::new();
    for plan in plans.map(shaken) {
        let report = Report::new(&plan);
        let (code, table) = check_plan(&plan);
        assert_eq!(code, Some(1), "{table:#}");
        let mut compared = 0;
        for row in report.rows.iter().filter(|row| row.grid == Grid::Samples) {
            let found = |field: &str| table[row.family.name()][field].as_f64();
            let worst =
                found("worst").unwrap_or_else(|| panic!("no row {}: {table:#}", row.family));
            // The script's numbers are SI; the two implementations round differently.
            let (_, factor) = row.family.unit().shown();
            let error = (worst * factor - row.worst).abs() / row.worst.max(1e-6);
            assert!(error < 1e-9, "{}: {worst} {}", row.family, row.worst);
            compared += 1;
        }
        assert!(compared >= 10, "{report}");
        seen.extend(report.rows.iter().filter(|row| row.worst > 0.0).map(|row| row.family));
    }
    // The start of a motion is not a residual of a plan. Numbers that repeat each other in the file are checked when
    // it is read. No plan here has end effectors too close to each other or joints beyond their limits.
    let unreported = [
        Family::Anchor,
        Family::BaseOrientation,
        Family::Duration,
        Family::Time,
        Family::Ends,
        Family::ContactFlag,
        Family::EndEffectorClearance,
        Family::JointLimit,
        Family::Foothold,
        Family::SwingClearance,
        Family::ObstacleClearance,
    ];
    for &family in Family::ALL {
        let expected = family.kind() != Kind::Cost && !unreported.contains(&family);
        assert_eq!(seen.contains(&family), expected, "{family}: {seen:?}");
    }
}
