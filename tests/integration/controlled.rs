//! Tests of the controller that tracks a plan for another simulator: a line in, a line out.

use crate::desk_with_shipped_files;
use rollwalk_tests::program::Program;
use rollwalk_tests::{Desk, Outcome};
use serde_json::{Value, json};
use std::io::Write;
use std::process::Stdio;
use std::thread;

/// Runs the controller on the given input lines, with ANYmal's standing plan; returns its answers.
fn answers(desk: &Desk, args: &[&str], lines: &[String]) -> Outcome {
    let mut command = desk.command(&[&["control", "stand.json"], args].concat());
    command.stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::piped());
    let mut program = Program::start(&mut command);
    let mut input = program.input().expect("a pipe");
    let lines = lines.concat();
    // The lines are written while answers are read, because answers fill the pipe. A program that has refused a line has closed
    // its input.
    let writing = thread::spawn(move || drop(input.write_all(lines.as_bytes())));
    let outcome = program.ends();
    writing.join().expect("it does not panic");
    outcome
}

fn stand() -> Desk {
    let desk = desk_with_shipped_files();
    desk.make(&["plan", "motions/anymal_stand.toml", "-o", "stand.json"]);
    desk
}

/// Returns a measurement of the robot in the initial state of its motion, from the first line of the program.
fn at_start(desk: &Desk) -> Value {
    let said = answers(desk, &[], &[]).succeeds();
    let hello: Value = serde_json::from_str(&said).expect("a record");
    assert_eq!((&hello["format"], &hello["tick_s"]), (&json!("rollwalk-control"), &json!(0.002)));
    assert_eq!((&hello["robot"], &hello["repeats"]), (&json!("anymal_wheels"), &json!(false)));
    assert_eq!(hello["channels"].as_array().map(Vec::len), Some(16));
    let mut record = hello["start"].clone();
    record["time_s"] = json!(0.0);
    record["touches"] = json!([true, true, true, true]);
    record
}

/// Asserts that a line is refused. Answers to earlier lines are ignored.
#[track_caller]
fn refused(outcome: Outcome, words: &[&str]) {
    Outcome { stdout: String::new(), ..outcome }.fails(1, words);
}

fn line(record: &Value) -> String {
    format!("{record}\n")
}

#[test]
fn a_robot_that_stands_as_planned_gets_torques_that_hold_it() {
    let desk = stand();
    let start = at_start(&desk);
    let mut lifted = start.clone();
    lifted["base"]["position_m"][2] =
        json!(start["base"]["position_m"][2].as_f64().unwrap() + 0.02);
    let torque = |answer: &str| -> Vec<f64> {
        let answer: Value = serde_json::from_str(answer).expect("a record");
        assert_eq!(answer["untracked"], Value::Null);
        let list = |key: &str| serde_json::from_value::<Vec<f64>>(answer[key].clone()).unwrap();
        let joints: Vec<f64> = serde_json::from_value(start["joint_rad"].clone()).unwrap();
        let (position, torque, kp) = (list("position_rad"), list("torque_nm"), list("kp_nm_rad"));
        (0..joints.len()).map(|k| torque[k] + kp[k] * (position[k] - joints[k])).collect()
    };
    let said = answers(&desk, &[], &[line(&start), line(&lifted)]).succeeds();
    let said: Vec<&str> = said.lines().collect();
    let (held, lowered) = (torque(said[1]), torque(said[2]));
    // Knees carry the weight, and less of it if the body is too high.
    for knee in [2, 5, 8, 11] {
        assert!(held[knee].abs() > 5.0 && lowered[knee].abs() < held[knee].abs(), "{said:?}");
    }
    // A robot that is rotated about the vertical together with its plan gets the same answer.
    let mut turned = start.clone();
    let half = std::f64::consts::FRAC_1_SQRT_2;
    turned["world_from_plan"] =
        json!({ "position_m": [0.0, 0.0, 0.0], "orientation_wxyz": [half, 0.0, 0.0, half] });
    let base = &mut turned["base"];
    let number = |of: &Value| of.as_f64().expect("a number");
    let [x, y, z] = [0, 1, 2].map(|k| number(&base["position_m"][k]));
    base["position_m"] = json!([-y, x, z]);
    let [w, x, y, z] = [0, 1, 2, 3].map(|k| half * number(&base["orientation_wxyz"][k]));
    base["orientation_wxyz"] = json!([w - z, x - y, y + x, z + w]);
    let said = answers(&desk, &[], &[line(&turned)]).succeeds();
    for (one, other) in torque(said.lines().nth(1).unwrap()).iter().zip(&held) {
        assert!((one - other).abs() < 1e-6, "{one} {other}");
    }
}

#[test]
fn an_imu_takes_the_place_of_the_base() {
    let desk = stand();
    let mut known = at_start(&desk);
    known["imu"] =
        json!({ "gyro_rad_s": [0.0, 0.0, 0.0], "accelerometer_m_s2": [0.0, 0.0, 9.80665] });
    let mut sensed = known.clone();
    sensed.as_object_mut().unwrap().remove("base");
    let said = answers(&desk, &[], &[line(&known), line(&sensed)]).succeeds();
    assert_eq!(said.matches("\"untracked\":null").count(), 2, "{said}");
    // A robot that has not stood still does not know its position.
    let said = answers(&desk, &["--feedback", "tasks"], &[line(&sensed)]).succeeds();
    assert!(said.contains("\"untracked\":\"the robot has not stood still yet\""), "{said}");
}

/// Checks that a short gap is bridged, and that a long one ends the motion.
#[test]
fn without_readings_a_motion_is_brought_to_a_stop() {
    let desk = stand();
    let mut known = at_start(&desk);
    known["imu"] =
        json!({ "gyro_rad_s": [0.0, 0.0, 0.0], "accelerometer_m_s2": [0.0, 0.0, 9.80665] });
    let mut blind = known.clone();
    for field in ["base", "imu"] {
        blind.as_object_mut().unwrap().remove(field);
    }
    let mut no_number = known.clone();
    no_number["joint_rad"][1] = Value::Null;
    let not_finite = "a sensor reading is not finite";
    for (broken, first, lost) in [
        (blind, "null".to_owned(), "the IMU is missing"),
        (no_number, format!("\"{not_finite}"), not_finite),
    ] {
        let ticks = (1..100).map(|tick| {
            let mut record = broken.clone();
            record["time_s"] = json!(0.002 * f64::from(tick));
            line(&record)
        });
        let lines: Vec<String> = std::iter::once(line(&known)).chain(ticks).collect();
        let said = answers(&desk, &[], &lines).succeeds();
        let said: Vec<&str> = said.lines().skip(1).collect();
        assert!(said[0].contains("\"untracked\":null"), "{}", said[0]);
        assert!(said[1].contains(&format!("\"untracked\":{first}")), "{}", said[1]);
        assert!(said[40].contains(lost), "{}", said[40]);
        assert!(said[99].contains("and stops the robot; start the motion again"), "{}", said[99]);
    }
}

/// Tests a loose plug, an encoder that has lost a turn, and a body that lies on its side.
#[test]
fn what_cannot_be_is_not_tracked_and_what_comes_and_goes_ends_the_motion() {
    let desk = stand();
    let start = at_start(&desk);
    let untracked = |change: &dyn Fn(u32, &mut Value)| -> Vec<String> {
        let ticks = (1..400).map(|tick| {
            let mut record = start.clone();
            record["time_s"] = json!(0.002 * f64::from(tick));
            change(tick, &mut record);
            line(&record)
        });
        let said = answers(&desk, &[], &ticks.collect::<Vec<_>>()).succeeds();
        let answer = |line: &str| serde_json::from_str::<Value>(line).expect("a record");
        said.lines().skip(1).map(|line| answer(line)["untracked"].to_string()).collect()
    };
    let loose = untracked(&|tick, of| {
        if tick % 2 == 0 {
            of["joint_rad"][1] = Value::Null;
        }
    });
    assert_eq!(loose[0], "null");
    assert!(loose[398].contains("and stops the robot; start the motion again"), "{}", loose[398]);
    let angle = start["joint_rad"][1].as_f64().unwrap();
    let turned = untracked(&|_, of| of["joint_rad"][1] = json!(angle + std::f64::consts::TAU));
    assert!(turned[0].contains("far beyond its joint's range"), "{}", turned[0]);
    let lies = untracked(&|_, of| of["base"]["orientation_wxyz"] = json!([0.0, 1.0, 0.0, 0.0]));
    assert!(lies[0].contains("has fallen"), "{}", lies[0]);
    assert!(lies[398].contains("and stops the robot; start the motion again"), "{}", lies[398]);
}

#[test]
fn lines_that_are_wrong_are_named() {
    let desk = stand();
    let start = at_start(&desk);
    let wrong = |change: &dyn Fn(&mut Value), words: &[&str]| {
        let mut record = start.clone();
        change(&mut record);
        let words = [&["line 2 of the input"], words].concat();
        refused(answers(&desk, &[], &[line(&start), line(&record)]), &words);
    };
    wrong(
        &|of| of["joint_rad"] = json!([0.0]),
        &["field joint_rad has 1 entries; anymal_wheels has 12 joints"],
    );
    wrong(&|of| of["touches"][3] = json!(1), &["field touches[3]: invalid type: integer `1`"]);
    wrong(&|of| of["imus"] = json!({}), &["unknown field `imus`"]);
    wrong(
        &|of| drop(of.as_object_mut().unwrap().remove("base")),
        &["base and imu are both missing"],
    );
    wrong(
        &|of| of["base"]["orientation_wxyz"] = json!([0.0, 0.0, 0.0, 0.5]),
        &["field base.orientation_wxyz has length 0.5; expected a quaternion of length 1"],
    );
    let place = json!({ "position_m": [0.0, 0.0, 0.0], "orientation_wxyz": [1.0, 0.0, 0.0, 0.0] });
    wrong(
        &|of| of["world_from_plan"] = place.clone(),
        &["world_from_plan is allowed in the first line only"],
    );
    for (time_s, words) in [
        (1.7e9, "field time_s is 1.7e9; expected at most 1000000 s"),
        (-0.002, "field time_s changes from 0 s to -0.002 s"),
    ] {
        wrong(&|of| of["time_s"] = json!(time_s), &[words]);
    }
    let at = |times_s: &[f64]| {
        let lines = times_s.iter().map(|time_s| {
            let mut record = start.clone();
            record["time_s"] = json!(time_s);
            line(&record)
        });
        answers(&desk, &[], &lines.collect::<Vec<_>>())
    };
    let words = "field time_s changes from 0.02 s to 0.04 s; expected ticks of 0.002 s";
    refused(at(&[0.0, 0.02, 0.04]), &["line 3 of the input", words]);
    refused(at(&[0.0, 0.001, 0.002]), &["line 3 of the input", "from 0.001 s to 0.002 s"]);
    // One line is missing, and the motion ends within a tick.
    at(&[0.0, 0.002, 0.006, 0.008, 0.0085, 0.0085, 0.0085]).succeeds();
    let placed = |field: &str, value: Value, words: &str| {
        let mut record = start.clone();
        record["world_from_plan"] = place.clone();
        record["world_from_plan"][field] = value;
        refused(answers(&desk, &[], &[line(&record)]), &["line 1 of the input", words]);
    };
    placed("position_m", json!([0.0, 1e20, 0.0]), "expected at most 10000 m from the origin");
    let half = std::f64::consts::FRAC_1_SQRT_2;
    placed("orientation_wxyz", json!([half, half, 0.0, 0.0]), "the ground is steeper than 45°");
    refused(
        answers(&desk, &["--bus", "sim"], &[]),
        &["--bus requires a library file", "stand.json is a plan"],
    );
    let nan = line(&start).replacen("\"time_s\":0.0", "\"time_s\":NaN", 1);
    refused(answers(&desk, &[], &[nan]), &["line 1 of the input"]);
}
