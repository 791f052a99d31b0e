//! Tests that `rollwalk send --arm` returns the robot to SAFE whatever happens.

use crate::simulated::{Robot, command_on, desk_with_library_file, on};
use rollwalk_bus::link::LinkBus;
use rollwalk_bus::port::LiveLink;
use rollwalk_bus::sim;
use rollwalk_protocol::wire::{FromController, State, Status, ToController};
use rollwalk_tests::program::{self, PLAYED, Program, within};
use rollwalk_tests::{Desk, Outcome};
use std::fs;
use std::os::unix::net::UnixListener;
use std::process::Stdio;

/// Starts a robot with a library, on a socket of this computer.
fn robot(desk: &Desk) -> (Robot, String) {
    let socket = format!("sim:{}", desk.path("robot.sock").display());
    desk.make(&["library", "build", "legbot.toml", "-o", "legbot.rwl"]);
    let robot = Robot::start(desk, &socket);
    on(desk, &socket, &["flash", "legbot.rwl"]).succeeds();
    (robot, socket)
}

/// Connects another program to the robot, as a listener.
fn listener(desk: &Desk) -> LiveLink {
    LiveLink::new(sim::connect(Some(&desk.path("robot.sock"))).expect("the robot is there"))
}

/// Waits for a status with the given state.
#[track_caller]
fn wait_for(link: &mut LiveLink, state: State) -> Status {
    let until_us = link.now_us() + 60_000_000;
    while let Some(frame) = link.receive(until_us).expect("the robot is there") {
        if let Ok((_, FromController::Status(status))) = FromController::decode(&frame)
            && status.state == state
        {
            return status;
        }
    }
    panic!("the robot does not become {state:?}");
}

fn start(desk: &Desk, bus: &str, args: &[&str]) -> Program {
    let mut command = command_on(desk, bus, args);
    Program::start(command.stdout(Stdio::piped()).stderr(Stdio::piped()))
}

/// Interrupts a program by Ctrl-C, and returns its outcome.
fn interrupted(program: Program) -> Outcome {
    program.signal("INT");
    program.ends()
}

#[test]
fn a_motion_that_is_refused_ends_at_home() {
    let desk = desk_with_library_file();
    let (_robot, bus) = robot(&desk);
    // Codes that the library lacks are refused before the robot moves ...
    let missing = ["no motion with code 99", "give one of 1 (stand), 2 (rest)"];
    on(&desk, &bus, &["send", "--arm", "2", "99"]).fails(1, &missing);
    // ... but only if the names are known.
    let mut command = command_on(&desk, &bus, &["send", "--arm", "2:0.3", "99"]);
    command.env("XDG_CACHE_HOME", desk.path("elsewhere"));
    let outcome = program::run(&mut command, PLAYED);
    outcome.fails(5, &["returning to SAFE", "disarmed", "no motion of the active library"]);
    on(&desk, &bus, &["doctor"]).succeeds_with(0, &["arm the robot: rollwalk send --arm"]);
}

#[test]
fn ctrl_c_brings_a_robot_home_that_aligns_and_one_that_plays() {
    let desk = desk_with_library_file();
    let (_robot, bus) = robot(&desk);
    let mut link = listener(&desk);
    for state in [State::Aligning, State::Playing] {
        let send = start(&desk, &bus, &["send", "--arm", "rest:60"]);
        wait_for(&mut link, state);
        let outcome = interrupted(send);
        assert_eq!(outcome.code, 130, "{state:?}: {}", outcome.stderr);
        assert!(outcome.stderr.ends_with("disarmed\n"), "{state:?}: {}", outcome.stderr);
        let status = wait_for(&mut listener(&desk), State::Disarmed);
        assert!(status.faults.is_empty(), "{state:?}: {status:?}");
    }
}

/// Silences the controller while it plays, and while it is paused.
#[test]
fn a_controller_that_falls_silent_is_not_waited_for() {
    let desk = desk_with_library_file();
    for paused in [false, true] {
        let (robot, bus) = robot(&desk);
        let mut link = listener(&desk);
        let send = start(&desk, &bus, &["send", "--arm", "rest:60"]);
        wait_for(&mut link, State::Playing);
        if paused {
            on(&desk, &bus, &["pause"]).succeeds();
            wait_for(&mut link, State::Paused);
        }
        drop(link);
        robot.signal("STOP");
        let outcome = send.ends();
        outcome.fails(
            5,
            &[
                "does not answer (status)",
                "no contact: without heartbeats a live controller returns the robot to SAFE",
            ],
        );
        // A stopped robot is killed, but its socket remains.
        drop(robot);
        let _ = fs::remove_file(desk.path("robot.sock"));
    }
}

/// Returns the numbers of the heartbeats sent so far.
fn heartbeats(link: &mut LiveLink) -> Vec<u8> {
    let mut numbers = Vec::new();
    let now_us = link.now_us();
    while let Some(frame) = link.receive(now_us).expect("the robot is there") {
        if let Ok((_, ToController::Heartbeat(heartbeat))) = ToController::decode(&frame) {
            numbers.push(heartbeat.seq);
        }
    }
    numbers
}

#[test]
fn beside_a_host_orders_are_given_without_heartbeats_and_no_second_host_begins() {
    let desk = desk_with_library_file();
    let (_robot, bus) = robot(&desk);
    let mut link = listener(&desk);
    let host = start(&desk, &bus, &["send", "--arm", "rest:600"]);
    wait_for(&mut link, State::Playing);
    heartbeats(&mut link);
    let run = |args: &[&str]| on(&desk, &bus, args);
    run(&["gains", "set", "all", "--kp", "62.5"]).succeeds();
    run(&["pause"]).succeeds();
    for second in [&["send", "--arm", "stand"][..], &["flash", "legbot.rwl"]] {
        run(second).fails(5, &["controller 1 already has a host", "end the other program first"]);
    }
    assert!(run(&["resume"]).succeeds().contains("the robot is playing"));
    run(&["send", "stand"]).succeeds();
    // The command waits for the end of each motion except the last, with names and without.
    let named = run(&["send", "rest:0.3", "stand"]);
    assert!(named.stderr.starts_with("playing rest\nstand begins in "), "{}", named.stderr);
    named.succeeds();
    let mut nameless = desk.command(&["send", "2:0.3", "1"]);
    nameless.env("ROLLWALK_BUS", &bus).env("XDG_CACHE_HOME", desk.path("elsewhere"));
    let nameless = program::run(&mut nameless, PLAYED);
    assert!(
        nameless.stderr.starts_with("playing code 2\ncode 1 begins in "),
        "{}",
        nameless.stderr
    );
    nameless.succeeds();
    run(&["send", "stand", "rest:9"]).fails(1, &["`rest:9`", "without --arm this program ends"]);
    run(&["return"]).succeeds();
    let numbers = heartbeats(&mut link);
    assert!(numbers.len() > 20, "{numbers:?}");
    // Within one program, each number is one more than the previous.
    assert!(numbers.windows(2).all(|two| two[1] == two[0].wrapping_add(1)), "{numbers:?}");
    assert_eq!(interrupted(host).code, 130);
}

#[test]
fn a_controller_that_does_not_answer_is_5_and_ctrl_c_is_130() {
    let desk = desk_with_library_file();
    let (robot, bus) = robot(&desk);
    let absent = ["--node", "9"];
    for command in
        [&["pause"][..], &["send", "--arm", "1"], &["flash", "legbot.rwl"], &["gains", "show"]]
    {
        let outcome = on(&desk, &bus, &[command, &absent].concat());
        outcome.fails(5, &["controller 9 does not answer"]);
    }
    drop(robot);
    // A socket that accepts bytes and never answers.
    let path = desk.path("nobody.sock");
    let nobody = UnixListener::bind(&path).expect("a socket");
    nobody.set_nonblocking(true).expect("a socket");
    let bus = format!("sim:{}", path.display());
    for command in ["discover", "disarm", "gains", "estop"] {
        let args = if command == "gains" { &["gains", "show"][..] } else { &[command] };
        let child = start(&desk, &bus, args);
        let _joined = within(&format!("{command} at the socket"), || nobody.accept().ok());
        assert_eq!(interrupted(child).code, 130, "{command}");
    }
}

#[test]
fn in_real_time_what_another_program_paused_does_not_move_because_time_ran_out() {
    let desk = desk_with_library_file();
    // The other program may take seconds to start.
    desk.edit("rest.toml", "duration_s = 0.6", "duration_s = 6.0");
    let (_robot, bus) = robot(&desk);
    let mut link = listener(&desk);
    let send = start(&desk, &bus, &["send", "--arm", "rest:1"]);
    wait_for(&mut link, State::Playing);
    on(&desk, &bus, &["pause"]).succeeds();
    wait_for(&mut link, State::Paused);
    // Longer than the duration of the motion.
    let until_us = link.now_us() + 8_000_000;
    while let Some(frame) = link.receive(until_us).expect("the robot is there") {
        if let Ok((_, FromController::Status(status))) = FromController::decode(&frame) {
            assert_eq!(status.state, State::Paused, "nobody let it go on");
        }
    }
    on(&desk, &bus, &["resume"]).succeeds();
    let outcome = send.ends();
    assert_eq!(outcome.code, 0, "{}", outcome.stderr);
    assert!(outcome.stderr.contains("paused by another program"), "{}", outcome.stderr);
}

#[test]
fn a_robot_that_another_program_disarms_is_held_until_it_is_down() {
    let desk = desk_with_library_file();
    let (_robot, bus) = robot(&desk);
    let send = start(&desk, &bus, &["send", "--arm", "rest:60"]);
    wait_for(&mut listener(&desk), State::Playing);
    on(&desk, &bus, &["disarm"]).succeeds();
    let outcome = send.ends();
    assert!(
        outcome.stderr.contains("another program has disarmed the robot"),
        "{}",
        outcome.stderr
    );
    assert_eq!(outcome.code, 5, "{}", outcome.stderr);
    on(&desk, &bus, &["doctor"]).succeeds_with(0, &["arm the robot: rollwalk send --arm"]);
}

#[test]
fn after_a_killed_host_doctor_advises_to_wait_and_clear() {
    let desk = desk_with_library_file();
    let (_robot, bus) = robot(&desk);
    let mut link = listener(&desk);
    let host = start(&desk, &bus, &["send", "--arm", "rest:60"]);
    wait_for(&mut link, State::Playing);
    host.signal("KILL");
    let doctor = on(&desk, &bus, &["doctor"]);
    assert!(!doctor.stdout.contains("console"), "{}", doctor.stdout);
    let next = format!("then type rollwalk clear --bus {bus}");
    doctor.succeeds_with(5, &["heartbeat lost", &next]);
    wait_for(&mut link, State::TorqueOff);
    on(&desk, &bus, &["clear"]).succeeds();
}

#[test]
fn a_motion_that_never_begins_beside_a_host_is_5() {
    let desk = desk_with_library_file();
    desk.edit("rest.toml", "at_rest", "periodic");
    // Starting two programs takes many seconds on a busy computer.
    desk.edit("rest.toml", "duration_s = 0.6", "duration_s = 60.0");
    let (_robot, bus) = robot(&desk);
    let mut link = listener(&desk);
    let host = start(&desk, &bus, &["send", "--arm", "rest:600"]);
    wait_for(&mut link, State::Playing);
    // The motion would begin after the end of the loop's cycle.
    let send = start(&desk, &bus, &["send", "stand"]);
    send.wait_for_words("stand begins in");
    on(&desk, &bus, &["pause"]).succeeds();
    wait_for(&mut link, State::Paused);
    let _ = on(&desk, &bus, &["return"]);
    let outcome = send.ends();
    assert_eq!(outcome.code, 5, "{}", outcome.stderr);
    assert!(!outcome.stderr.contains("playing"), "{}", outcome.stderr);
    assert_eq!(host.ends().code, 5);
}

#[test]
fn a_robot_that_another_program_sends_home_stays_there() {
    let desk = desk_with_library_file();
    // A periodic motion would continue.
    desk.edit("rest.toml", "at_rest", "periodic");
    let (_robot, bus) = robot(&desk);
    let send = start(&desk, &bus, &["send", "--arm", "rest:60", "rest:60"]);
    send.wait_for_words("playing rest");
    on(&desk, &bus, &["pause"]).succeeds();
    send.wait_for_words("paused by another program");
    on(&desk, &bus, &["resume"]).succeeds();
    on(&desk, &bus, &["pause"]).succeeds();
    // The message of the pause offers this command.
    on(&desk, &bus, &["return"]).succeeds();
    let outcome = send.ends();
    assert!(!outcome.stderr.contains("waited for"), "{}", outcome.stderr);
    assert!(outcome.stderr.contains("nothing more is played"), "{}", outcome.stderr);
    assert_eq!(outcome.stderr.matches("playing rest").count(), 1, "{}", outcome.stderr);
    assert_eq!(outcome.code, 5, "{}", outcome.stderr);
    on(&desk, &bus, &["doctor"]).succeeds_with(0, &["arm the robot: rollwalk send --arm"]);
}
