//! Tests of the tools with a simulated robot on a socket of this computer, the first steps of a maker without CAN.

use crate::desk_with_shipped_files;
use crate::simulated::{Robot, command_on, desk_with_library_file, in_time, on};
use rollwalk_tests::program::{self, PLAYED, Program, within};
use std::process::{Command, Stdio};
use std::thread::sleep;
use std::time::Duration;

#[test]
fn a_library_is_built_flashed_and_played_by_name_and_the_robot_is_stopped_and_cleared() {
    let desk = desk_with_library_file();
    let socket = format!("sim:{}", desk.path("robot.sock").display());
    let run = |args: &[&str]| on(&desk, &socket, args);
    run(&["library", "build", "legbot.toml", "-o", "legbot.rwl"]).succeeds();
    let nobody = run(&["discover"]);
    nobody.fails(1, &["no simulated robot", "rollwalk-sim ROBOT.toml --bus sim:"]);

    let robot = Robot::start(&desk, &socket);
    let found = run(&["discover"]);
    assert!(found.stdout.contains("legbot"), "{}", found.stdout);
    let next = format!("flash a library with `rollwalk flash LIB.rwl --bus {socket}`");
    assert!(found.stderr.contains(&next), "{}", found.stderr);
    assert!(run(&["discover", "--json"]).succeeds().contains("\"library\": null"));
    run(&["send", "--arm", "1"]).fails(5, &["no motion library", "rollwalk flash"]);
    run(&["doctor"])
        .succeeds_with(5, &["flash a library: rollwalk flash LIB.rwl --robot ROBOT.toml"]);
    let flashed = run(&["flash", "legbot.rwl"]).succeeds();
    assert!(flashed.contains("legbot has library"), "{flashed}");
    run(&["send", "rest"]).fails(5, &["torque is off; arm first", "rollwalk send --arm MOTION"]);
    run(&["send", "--arm", "run"]).fails(1, &["no motion `run`", "give one of stand, rest"]);
    run(&["send", "--arm", "rest", "--speed", "2"]).fails(2, &["from 0.016 (1/64) to 1"]);
    in_time(&desk, &socket, &["send", "--arm", "rest", "1"]).succeeds();
    run(&["doctor"]).succeeds_with(0, &["arm the robot: rollwalk send --arm"]);

    run(&["gains", "set", "all", "--kp", "12.5"]).succeeds();
    assert!(run(&["gains", "show", "--json"]).succeeds().contains("12.5"));
    run(&["gains", "feed-forward", "0.25"]).succeeds();
    assert!(run(&["gains", "show"]).succeeds().contains("feed-forward: 0.250"));
    for wrong in ["1.5", "-1", "NaN"] {
        run(&["gains", "feed-forward", wrong]).fails(2, &["a number from 0 to 1"]);
    }
    run(&["gains", "set", "nose", "--kp", "1"]).fails(1, &["no joint or wheel `nose`"]);
    run(&["gains", "set", "0", "--kp", "-1"]).fails(2, &["a number of at least 0"]);
    let legs = ["front_left_hip_roll: --kp 600 N·m/rad is too high", "nothing was changed"];
    let refused = run(&["gains", "set", "0", "--kp", "600"]);
    refused.fails(5, &legs);

    let without =
        ["the controller cannot store parameters", "rollwalk-sim has one only with --library"];
    run(&["gains", "save"]).fails(5, &without);
    run(&["estop"]).succeeds();
    run(&["gains", "save"])
        .fails(5, &["the robot has stopped, and torque is off; clear the stop first"]);
    run(&["send", "--arm", "rest"]).fails(5, &["refused to arm"]);
    run(&["doctor"])
        .succeeds_with(5, &["stopped by an emergency stop", "rollwalk clear --bus sim:"]);
    run(&["clear"]).succeeds();
    run(&["clear"]).succeeds();
    in_time(&desk, &socket, &["send", "--arm", "2"]).succeeds();

    run(&["monitor", "--for", "0.3", "--log", "run.log", "--mcap", "run.mcap"]).succeeds();
    let again = run(&["monitor", "--for", "0.3", "--log", "run.log"]);
    assert!(again.stderr.contains("the previous recording is now"), "{}", again.stderr);
    let silent = ["controller 3 does not answer", "controller 1 is on this bus"];
    run(&["monitor", "--for", "1", "--node", "3"]).fails(5, &silent);
    run(&["monitor", "--for=-3"]).fails(2, &["must be from 0 to 31536000"]);
    assert!(desk.read_text("run.log").contains(" sim0 310#"));
    assert!(desk.read("run.mcap").starts_with(b"\x89MCAP0\r\n"));
    drop(robot);
    run(&["discover"]).fails(1, &["no simulated robot"]);
}

#[test]
fn a_library_for_another_robot_and_a_bus_that_is_none_are_refused() {
    let desk = desk_with_shipped_files();
    desk.write("not.rwl", [b'x'; 100]);
    on(&desk, "sim", &["flash", "not.rwl"]).fails(1, &["not.rwl", "not a motion library"]);
    on(&desk, "sim", &["flash", "none.rwl"]).fails(1, &["no motion library at none.rwl"]);
    on(&desk, "can1", &["doctor"]).fails(2, &["`can1` is not a bus", "such as can:can0"]);
    on(&desk, "serial:/dev/ttyNONE", &["doctor"]).fails(1, &["no device `/dev/ttyNONE`"]);
    on(&desk, "slcan:/dev/null@123", &["doctor"])
        .fails(1, &["do not support 123 bit/s", "1000000 bit/s"]);
    on(&desk, "sim", &["doctor", "--node", "15"]).fails(2, &["an address from 0 to 14"]);
}

#[test]
fn all_gains_are_those_that_there_are() {
    let desk = desk_with_shipped_files();
    let socket = format!("sim:{}", desk.path("robot.sock").display());
    let _robot = Robot::on_stand(&desk, "robots/test_leg.toml", &socket);
    let set = on(&desk, &socket, &["gains", "set", "all", "--kp", "20"]);
    // A wheel has no stiffness.
    assert!(
        set.stderr.contains("these channels do not have this parameter: wheel"),
        "{}",
        set.stderr
    );
    assert!(set.succeeds().starts_with("2 values set"));
    let set = on(&desk, &socket, &["gains", "set", "all", "--kp", "20", "--kd", "1"]);
    assert!(set.stderr.trim_end().ends_with("do not have this parameter: wheel"), "{}", set.stderr);
    for wrong in ["--kp=-1", "--kd=-1", "--kp=NaN"] {
        let refused = on(&desk, &socket, &["gains", "set", "all", wrong]);
        refused.fails(2, &["a number of at least 0"]);
    }
    let args = ["gains", "set", "2", "--kp", "20"];
    on(&desk, &socket, &args).fails(5, &["--kp 20 N·m/rad: this channel does not have this value"]);
    let args = ["gains", "set", "0", "--torque-limit", "0.01"];
    on(&desk, &socket, &args).fails(5, &["--torque-limit 0.01 N·m is too low: give at least"]);
    // A car has only wheels.
    let socket = format!("sim:{}", desk.path("car.sock").display());
    let _car = Robot::on_ground(&desk, "robots/car.toml", &socket);
    on(&desk, &socket, &["gains", "set", "all", "--kp", "20"])
        .fails(5, &["these channels do not have this parameter: front_left", "nothing was set"]);
}

#[test]
fn a_simulated_robot_keeps_its_library_and_loses_none() {
    let desk = desk_with_library_file();
    let bus = format!("sim:{}", desk.path("robot.sock").display());
    let run = |args: &[&str]| on(&desk, &bus, args);
    run(&["library", "build", "legbot.toml", "-o", "first.rwl"]).succeeds();
    desk.edit("legbot.toml", "duration_s = 0.5", "duration_s = 0.6");
    run(&["library", "build", "legbot.toml", "-o", "second.rwl"]).succeeds();
    let (first, second) = (desk.read("first.rwl"), desk.read("second.rwl"));
    assert_ne!(first, second);
    let has = |name: &str| std::fs::read(desk.path(name)).unwrap_or_default();
    let until = |name: &str, content: &[u8]| {
        within(&format!("the library in {name}"), || (has(name) == content).then_some(()));
    };
    let switched_on = || Robot::with(&desk, &bus, &["--library", "kept.rwl"]);

    let robot = switched_on();
    run(&["flash", "first.rwl"]).succeeds();
    until("kept.rwl", &first);
    drop(robot);
    let robot = switched_on();
    in_time(&desk, &bus, &["send", "--arm", "rest"]).succeeds();
    run(&["flash", "second.rwl"]).succeeds();
    until("kept.rwl", &second);
    // The library found on the robot may be the only copy, but not the library that was just flashed.
    assert_eq!(has("kept.2.rwl"), first);
    run(&["flash", "first.rwl"]).succeeds();
    until("kept.rwl", &first);
    assert!(!desk.path("kept.3.rwl").exists());
    drop(robot);

    let refused = |library: &str, words: &[&str]| {
        let mut command = Command::new(env!("CARGO_BIN_EXE_rollwalk-sim-under-test"));
        command.args(["robots/legbot.toml", "--bus", &bus, "--library", library]);
        command.current_dir(desk.path("")).env("COLUMNS", "1000");
        program::run(&mut command, PLAYED).fails(1, words);
    };
    refused("robots/legbot.toml", &["a robot file (TOML) that this command reads"]);
    refused("stand.toml", &["stand.toml", "not a motion library"]);
    refused("none/kept.rwl", &["there is no folder none"]);
}

#[test]
fn a_reader_that_has_seen_enough_does_not_change_how_a_command_ends() {
    let desk = desk_with_shipped_files();
    let bus = format!("sim:{}", desk.path("robot.sock").display());
    let _robot = Robot::start(&desk, &bus);
    let (reader, writer) = std::io::pipe().unwrap();
    drop(reader);
    let mut doctor = command_on(&desk, &bus, &["doctor"]);
    let outcome = Program::start(doctor.stdout(writer).stderr(Stdio::null())).ends();
    // The robot has no library.
    assert_eq!(outcome.code, 5);
}

/// Sends forged frames with the controller's identifier. The simulated robot must still print its own state.
#[cfg(unix)]
#[test]
fn a_simulated_robot_prints_its_own_state_and_no_forged_one() {
    use rollwalk_bus::sim;
    use rollwalk_protocol::faults::{FaultBits, Severity};
    use rollwalk_protocol::wire::{Node, State, Status};
    let desk = desk_with_library_file();
    let socket = desk.path("robot.sock");
    let bus = format!("sim:{}", socket.display());
    let mut robot = Robot::start_logged(&desk, &["robots/legbot.toml"], &bus, "said.txt");
    let mut forger = sim::connect(Some(&socket)).unwrap();
    for counter in 0..50 {
        let (faults, severity) = (FaultBits::default(), Severity::None);
        let state = State::Playing;
        let forged =
            Status { state, severity, faults, clip: Some(1), frame: 0, counter, library: 7 };
        let node = Node::new(1).unwrap();
        forger.outlet.send(&forged.encode(node)).unwrap();
        sleep(Duration::from_millis(5));
    }
    on(&desk, &bus, &["estop"]).succeeds();
    robot.stop();
    let said = desk.read_text("said.txt");
    assert!(said.contains("disarmed") && said.contains("emergency"), "{said}");
    assert!(!said.contains("playing"), "{said}");
}

/// Gains that were saved are in force after a restart of the simulator.
#[test]
fn saved_gains_of_a_simulated_robot_outlive_it() {
    let desk = desk_with_shipped_files();
    let bus = format!("sim:{}", desk.path("robot.sock").display());
    let run = |args: &[&str]| on(&desk, &bus, args);
    let mut robot = Robot::with(&desk, &bus, &["--library", "kept.rwl"]);
    run(&["gains", "set", "all", "--kp", "12.5"]).succeeds();
    run(&["gains", "save"]).succeeds();
    assert!(desk.read_text("kept.gains.json").contains("\"kp_nm_rad\": 12.5"));
    robot.stop();
    let _robot = Robot::with(&desk, &bus, &["--library", "kept.rwl"]);
    let shown = run(&["gains", "show"]).succeeds();
    assert!(shown.contains("12.500") && shown.contains("came from the saved values"), "{shown}");
}

/// A robot that goes away ends a monitor with the exit code for robots that do not answer.
#[test]
fn a_bus_that_is_lost_while_a_monitor_listens_is_5() {
    let desk = desk_with_shipped_files();
    let bus = format!("sim:{}", desk.path("robot.sock").display());
    let mut robot = Robot::with(&desk, &bus, &[]);
    let mut monitor = command_on(&desk, &bus, &["monitor", "--for", "60"]);
    let monitor = Program::start(monitor.stdout(Stdio::piped()).stderr(Stdio::piped()));
    monitor.wait_for_words("disarmed");
    robot.stop();
    let outcome = monitor.ends();
    assert_eq!(outcome.code, 5, "{}", outcome.stderr);
    assert!(outcome.stderr.contains("is lost"), "{}", outcome.stderr);
}
