//! Tests of the tools and a simulated robot on virtual CAN interfaces.

mod drives;

use crate::bench::{BackgroundProgram, LONG, desk, flash, keep, log, rollwalk, run, states};
use rollwalk_bus::candump::LogEntry;
use rollwalk_protocol::wire::State;
use std::thread::sleep;
use std::time::{Duration, Instant};

const LINK: [&str; 2] = ["--bus", "can:vcan0"];
const ACTUATORS: [&str; 4] = ["--actuators", "can:vcan1", "--actuators", "can:vcan2"];

#[track_caller]
fn on_link(args: &[&str]) -> rollwalk_tests::Outcome {
    rollwalk(&[args, &LINK].concat())
}

/// Transfers the library and plays each of its motions by its code.
#[track_caller]
fn flash_and_play() {
    let found = on_link(&["discover", "--json"]).succeeds();
    assert!(found.contains("\"node\": 1"), "{found}");
    flash(LINK[1]).succeeds();
    on_link(&["send", "--arm", "2", "4:3", "3:3", "1"]).succeeds();
}

/// Plays, stops, clears and plays again on `vcan0`, both with the simulated robot and with the emulated board.
#[track_caller]
pub fn play_stop_clear_and_play() {
    flash_and_play();
    on_link(&["estop"]).succeeds();
    on_link(&["send", "--arm", "2"]).fails(5, &["refused to arm"]);
    on_link(&["doctor"]).succeeds_with(5, &["stopped by an emergency stop", "rollwalk clear"]);
    on_link(&["clear"]).succeeds();
    on_link(&["send", "--arm", "2"]).succeeds();
}

/// Returns the number of transitions from `before` to `after`.
fn count(states: &[(State, Option<u8>)], before: State, after: State) -> usize {
    states.windows(2).filter(|pair| pair[0].0 == before && pair[1].0 == after).count()
}

#[test]
#[ignore = "needs CAN interfaces: cargo xtask vcan"]
fn a_robot_plays_is_stopped_cleared_and_plays_again_and_a_log_of_it_says_the_same() {
    let desk = desk();
    let (link_log, lines) = (desk.join("link.log"), desk.join("monitor.jsonl"));
    let (log_of_ours, mcap) = (desk.join("monitor.log"), desk.join("monitor.mcap"));
    let candumps = [
        BackgroundProgram::candump("vcan0", &link_log),
        BackgroundProgram::candump("vcan1", &desk.join("actuators1.log")),
        BackgroundProgram::candump("vcan2", &desk.join("actuators2.log")),
    ];
    let (ours, telemetry) = (log_of_ours.to_str().unwrap(), mcap.to_str().unwrap());
    let options = [&LINK[..], &["--log", ours, "--mcap", telemetry]].concat();
    let monitor = BackgroundProgram::monitor(&options, &lines);
    let robot = BackgroundProgram::robot(&[&LINK[..], &ACTUATORS].concat());

    play_stop_clear_and_play();
    on_link(&["gains", "show"]).succeeds();

    sleep(Duration::from_millis(200));
    assert_eq!(robot.interrupt(), 0);
    assert_eq!(monitor.interrupt(), 0);
    drop(candumps);
    for name in ["link.log", "monitor.jsonl", "monitor.mcap", "actuators1.log", "actuators2.log"] {
        keep(name);
    }

    let frames = log(&link_log);
    let seen = states(&frames);
    assert_eq!(count(&seen, State::Disarmed, State::Aligning), 2, "{seen:?}");
    assert_eq!(count(&seen, State::Disarmed, State::EStopped), 1, "{seen:?}");
    assert_eq!(count(&seen, State::EStopped, State::Disarmed), 1, "{seen:?}");
    let played = |clip| seen.contains(&(State::Playing, Some(clip)));
    // Every motion, and every transition to and from SAFE.
    assert!((0..4).all(played), "{seen:?}");
    assert_eq!(seen.last(), Some(&(State::Disarmed, None)), "{seen:?}");
    // Monitor and candump recorded the same states.
    assert_eq!(states(&log(&log_of_ours)), seen);

    // A replay of the log without a robot gives the same states.
    let again = desk.join("replayed.log");
    let candump = BackgroundProgram::candump("vcan0", &again);
    let monitor = BackgroundProgram::monitor(&LINK, &desk.join("replayed.jsonl"));
    run("canplayer", &["-I", link_log.to_str().unwrap(), "vcan0=vcan0"]);
    sleep(Duration::from_millis(200));
    assert_eq!(monitor.interrupt(), 0);
    drop(candump);
    assert_eq!(states(&log(&again)), seen);
    assert_eq!(log(&again).len(), frames.len());
}

#[test]
#[ignore = "needs CAN interfaces: cargo xtask vcan"]
fn controller_and_motors_can_be_programs_of_their_own() {
    let motors = BackgroundProgram::robot(&[&["--only", "motors"][..], &ACTUATORS].concat());
    let controller = [&["--only", "controller"][..], &LINK, &ACTUATORS].concat();
    let controller = BackgroundProgram::robot(&controller);
    flash_and_play();
    assert_eq!(controller.interrupt(), 0);
    assert_eq!(motors.interrupt(), 0);
}

#[test]
#[ignore = "needs CAN interfaces: cargo xtask vcan"]
fn motors_that_die_are_noticed_and_named() {
    let motors = BackgroundProgram::robot(&[&["--only", "motors"][..], &ACTUATORS].concat());
    let controller = [&["--only", "controller"][..], &LINK, &ACTUATORS].concat();
    let controller = BackgroundProgram::robot(&controller);
    flash(LINK[1]).succeeds();
    let send = BackgroundProgram::rollwalk(&[&["send", "--arm", "4:30"][..], &LINK].concat());
    sleep(Duration::from_secs(4));
    assert_eq!(motors.interrupt(), 0);
    send.outcome().fails(5, &["does not answer"]);
    on_link(&["doctor"]).succeeds_with(5, &["an actuator does not answer", "rollwalk clear"]);
    // The motors return: after a clear, the robot plays again.
    let motors = BackgroundProgram::robot(&[&["--only", "motors"][..], &ACTUATORS].concat());
    on_link(&["clear"]).succeeds();
    on_link(&["send", "--arm", "2"]).succeeds();
    drop((controller, motors));
}

#[test]
#[ignore = "needs CAN interfaces: cargo xtask vcan"]
fn a_bus_that_goes_stops_the_robot_and_one_that_comes_back_serves_again() {
    let robot = BackgroundProgram::robot(&[&LINK[..], &ACTUATORS].concat());
    flash(LINK[1]).succeeds();
    let send = BackgroundProgram::rollwalk(&[&["send", "--arm", "4:30"][..], &LINK].concat());
    sleep(Duration::from_secs(4));
    run("ip", &["link", "set", "vcan2", "down"]);
    let outcome = send.outcome();
    run("ip", &["link", "set", "vcan2", "up"]);
    outcome.fails(5, &["an actuator bus is lost"]);
    // After a clear, controller and motors work again.
    on_link(&["clear"]).succeeds();
    on_link(&["send", "--arm", "stand"]).succeeds();
    drop(robot);
}

#[test]
#[ignore = "needs CAN interfaces: cargo xtask vcan"]
fn what_is_wrong_with_a_bus_is_said_with_what_to_type() {
    flash("can:vcan7")
        .fails(1, &["no network interface `vcan7`", "sudo ip link add vcan7 type vcan"]);
    flash("can:can9").fails(1, &["no network interface `can9`", "vcan0, vcan1, vcan2"]);
    flash("can:lo").fails(1, &["`lo` is a network interface, but not a CAN interface"]);
    flash("vcan0").fails(2, &["`vcan0` is not a bus"]);
    flash("serial:/dev/ttyUSB7").fails(1, &["no device `/dev/ttyUSB7`"]);
    // No controller answers.
    flash("can:vcan0").fails(5, &["does not answer", "rollwalk discover --bus can:vcan0"]);
    rollwalk(&["discover", "--bus", "can:vcan0"]).fails(5, &["no controller answers on can:vcan0"]);
    run("ip", &["link", "set", "vcan1", "down"]);
    let down = flash("can:vcan1");
    run("ip", &["link", "set", "vcan1", "up"]);
    down.fails(1, &["`vcan1` is down", "sudo ip link set vcan1 up"]);
}

#[test]
#[ignore = "needs CAN interfaces: cargo xtask vcan"]
fn an_adapter_that_is_unplugged_in_a_transfer_is_said_and_the_robot_outlives_it() {
    let plug = || {
        run("ip", &["link", "add", "vcan5", "type", "vcan"]);
        run("ip", &["link", "set", "vcan5", "up"]);
    };
    plug();
    let transfer = desk().join("transfer.log");
    let candump = BackgroundProgram::candump("vcan5", &transfer);
    let robot = BackgroundProgram::robot(&["--bus", "can:vcan5"]);
    let unplugged = BackgroundProgram::flash("can:vcan5");
    let is_block = |entry: &LogEntry| entry.frame.standard_id() == Some(0x510);
    let start = Instant::now();
    while log(&transfer).iter().filter(|entry| is_block(entry)).count() < 300 {
        assert!(start.elapsed() < LONG, "no transfer");
        sleep(Duration::from_millis(2));
    }
    run("ip", &["link", "del", "vcan5"]);
    unplugged.outcome().fails(5, &["vcan5", "Run the same command again"]);
    drop(candump);
    plug();
    // The simulator searches for its link twice a second.
    sleep(Duration::from_secs(1));
    flash("can:vcan5").succeeds();
    assert_eq!(robot.interrupt(), 0);
    run("ip", &["link", "del", "vcan5"]);
}
