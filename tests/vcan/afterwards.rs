//! Tests that other programs can read the logs: python-can with cantools, and an MCAP reader.

use crate::bench::{every_state, log, results};
use crate::board;
use rollwalk_protocol::wire::State;
use rollwalk_tests::checkout;
use serde_json::{Map, Value};
use std::collections::BTreeSet;
use std::fs;
use std::process::Command;

/// Decodes the frames of a log with cantools.
fn decoded(log: &str, dbc: &str) -> Vec<Value> {
    let docs = checkout().join("docs");
    let output = Command::new("python3")
        .arg(docs.join("formats/decode_log.py"))
        .args([results().join(log), docs.join(dbc)])
        .arg("--all")
        .output()
        .expect("python3 runs docs/formats/decode_log.py");
    let errors = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{log}: {errors}");
    lines(&String::from_utf8(output.stdout).expect("JSON"))
}

fn lines(text: &str) -> Vec<Value> {
    text.lines().map(|line| serde_json::from_str(line).expect("a JSON object in a line")).collect()
}

/// Compares the signals that both decoders report under the same name; returns the number of signals.
fn compare(theirs: &Map<String, Value>, ours: &Map<String, Value>, line: &Value) -> usize {
    let mut compared = 0;
    for (name, ours) in ours {
        let Some(theirs) = theirs.get(name) else { continue };
        compared += 1;
        match (ours.as_f64(), theirs.as_f64()) {
            (Some(ours), Some(theirs)) => {
                // Our values are single precision.
                assert!((ours - theirs).abs() <= 1e-6 * ours.abs().max(1e-3), "{name}: {line}");
            }
            // A serial number: digits in our output, a number in theirs.
            (None, Some(theirs)) if name == "uid" => {
                let digits = u64::from_str_radix(ours.as_str().unwrap(), 16).unwrap();
                assert_eq!(digits as f64, theirs, "{name}: {line}");
            }
            (None, None) if ours.is_string() => assert_eq!(ours, theirs, "{name}: {line}"),
            // Without clip or channel, our output has no value, theirs a name for the number.
            _ => assert!(ours.is_null() && !theirs.is_null(), "{name}: {line}"),
        }
    }
    compared
}

#[test]
#[ignore = "reads the logs of cargo xtask vcan"]
fn cantools_decodes_every_frame_to_what_the_monitor_printed() {
    let theirs = decoded("link.log", "rollwalk.dbc");
    let ours = lines(&fs::read_to_string(results().join("monitor.jsonl")).expect("the monitor's"));
    let key = |line: &Value| (line["id"].clone(), line["data"].clone());
    // The monitor started later, and decoded every frame since then.
    let mut rest = theirs.iter();
    let (mut compared, mut messages) = (0, BTreeSet::new());
    for line in &ours {
        let found =
            rest.find(|theirs| key(theirs) == key(line)).unwrap_or_else(|| panic!("{line}"));
        let message = line["message"].as_str().unwrap_or_else(|| panic!("{line}"));
        let name = found["message"].as_str().expect("cantools names it").to_lowercase();
        assert!(name.starts_with(message), "{found} {line}");
        let (signals, own) = (found["signals"].as_object(), line["signals"].as_object());
        compared += compare(signals.unwrap(), own.unwrap(), line);
        messages.insert(message.to_owned());
    }
    assert!(
        ours.len() > 1000 && theirs.len() - ours.len() < 1000,
        "{} {}",
        ours.len(),
        theirs.len()
    );
    assert!(compared > 3 * ours.len(), "{compared} signals of {} frames", ours.len());
    println!("{} frames, {compared} signals of {messages:?}", ours.len());
    for message in ["status", "command", "command_ack", "joint", "heartbeat", "estop", "discovered"]
    {
        assert!(messages.contains(message), "{message} of {messages:?}");
    }
}

/// State and clip in a log, and the number of consecutive statuses with both.
type Stretch = ((State, Option<u8>), usize);

/// Returns the states and clips in a log, from the first disarmed state on.
fn played(name: &str) -> Vec<Stretch> {
    let states = every_state(&log(&results().join(name)));
    let mut played: Vec<Stretch> = Vec::new();
    for state in states.into_iter().skip_while(|&(state, _)| state != State::Disarmed) {
        match played.last_mut() {
            Some((last, count)) if *last == state => *count += 1,
            _ => played.push((state, 1)),
        }
    }
    played
}

/// Returns the parts that only one of two logs contains.
fn difference(one: &[Stretch], other: &[Stretch]) -> Vec<Stretch> {
    // Lengths of the longest common subsequences of both remainders.
    let mut common = vec![vec![0; other.len() + 1]; one.len() + 1];
    for i in (0..one.len()).rev() {
        for j in (0..other.len()).rev() {
            common[i][j] = if one[i].0 == other[j].0 {
                1 + common[i + 1][j + 1]
            } else {
                common[i + 1][j].max(common[i][j + 1])
            };
        }
    }
    let (mut i, mut j, mut alone) = (0, 0, Vec::new());
    while i < one.len() || j < other.len() {
        if i < one.len() && j < other.len() && one[i].0 == other[j].0 {
            (i, j) = (i + 1, j + 1);
        } else if j == other.len() || (i < one.len() && common[i + 1][j] >= common[i][j + 1]) {
            alone.push(one[i]);
            i += 1;
        } else {
            alone.push(other[j]);
            j += 1;
        }
    }
    alone
}

/// Compares the states and motions in both logs. Short differences are allowed: statuses arrive only every 50 ms, so that a log
/// may lack a motion that begins just as a RETURN arrives.
#[test]
#[ignore = "reads the logs of cargo xtask vcan"]
fn the_board_played_what_the_simulated_robot_played() {
    let (board, robot) = (played(board::LOG), played("link.log"));
    assert!(board.len() > 20, "{board:?}");
    let alone = difference(&board, &robot);
    assert!(
        alone.len() <= 2 && alone.iter().all(|&(_, count)| count <= 2),
        "{alone:?}\n{board:?}\n{robot:?}"
    );
    println!("the board and the simulated robot: {board:?}; one of them alone: {alone:?}");
}

#[test]
fn the_difference_of_two_logs_is_what_one_of_them_has() {
    let stretches = |clips: &[(u8, usize)]| -> Vec<Stretch> {
        clips.iter().map(|&(clip, count)| ((State::Playing, Some(clip)), count)).collect()
    };
    let (one, other) =
        (stretches(&[(1, 9), (2, 9), (3, 1), (4, 9)]), stretches(&[(1, 8), (2, 9), (4, 9)]));
    assert_eq!(difference(&one, &other), stretches(&[(3, 1)]));
    assert_eq!(difference(&other, &one), stretches(&[(3, 1)]));
    assert_eq!(difference(&one, &one), []);
    // Another order is not equal.
    assert_eq!(difference(&one, &stretches(&[(2, 9), (1, 9), (3, 1), (4, 9)])).len(), 2);
}

#[test]
#[ignore = "reads the logs of cargo xtask vcan"]
fn cantools_decodes_every_frame_of_the_actuator_buses() {
    for log in ["actuators1.log", "actuators2.log"] {
        let frames = decoded(log, "rollwalk-actuators.dbc");
        assert!(frames.len() > 10_000, "{log}: {}", frames.len());
    }
}

#[test]
#[ignore = "reads the logs of cargo xtask vcan"]
fn the_telemetry_holds_joint_states_as_measured_and_as_planned() {
    let bytes = fs::read(results().join("monitor.mcap")).expect("the telemetry");
    let (mut measured, mut compared) = (0, 0);
    let mut worst_rad = 0.0_f64;
    let mut last = None::<Value>;
    for message in mcap::MessageStream::new(&bytes).expect("an MCAP file") {
        let message = message.expect("a message");
        let content: Value = serde_json::from_slice(&message.data).expect("JSON");
        match message.channel.topic.as_str() {
            "/joint_states" => {
                measured += 1;
                last = Some(content);
            }
            "/planned_joint_states" => {
                let Some(last) = &last else { continue };
                let joints = |states: &Value| states["joints"].as_array().unwrap().clone();
                for (plan, is) in joints(&content).iter().zip(joints(last)) {
                    assert_eq!(plan["name"], is["name"]);
                    if let (Some(plan), Some(is)) =
                        (plan["position"].as_f64(), is["position"].as_f64())
                    {
                        compared += 1;
                        worst_rad = worst_rad.max((plan - is).abs());
                    }
                }
            }
            _ => {}
        }
    }
    println!(
        "{measured} joint states; {compared} positions at most {worst_rad:.3} rad from the plan"
    );
    assert!(measured > 100, "{measured}");
    assert!(compared > 100, "{compared}");
    // A status is up to 50 ms old, and joints rotate at up to 6 rad/s. A wrong order would cause a greater error.
    assert!(worst_rad < 0.35, "{worst_rad}");
}
