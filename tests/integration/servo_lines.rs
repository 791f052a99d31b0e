//! Tests of a robot with servos on a serial line: in virtual time, and in real time with controller and motors as two programs.
//! A pseudo terminal connects the two, like a computer and servos on an adapter.

use crate::desk_with_shipped_files;
use crate::results::json;
use crate::simulated::{Robot, in_time, on};
use rollwalk_tests::Desk;
use rollwalk_tests::program::{self, PLAYED, within};
use std::fs;
use std::process::Command;

const ROBOT: &str = "robots/pup.toml";

#[test]
fn the_demo_plays_a_robot_on_a_serial_line() {
    let desk = desk_with_shipped_files();
    let args = ["demo", "--library", "motions/pup_library.toml", "--out", "out", "--json"];
    let outcome = json(&desk.run(&args).succeeds());
    let clips = outcome["clips"].as_array().unwrap();
    let names: Vec<_> = clips.iter().map(|clip| clip["name"].as_str().unwrap()).collect();
    assert!(["stand", "drive", "walk"].iter().all(|name| names.contains(name)), "{names:?}");
    for clip in clips {
        // Two packets of set-points, a query and twelve answers: 366 bytes of ten bits at 1 Mbit/s, 120 times per second.
        let load = clip["bus_load"].as_f64().unwrap();
        assert!((load - 0.439).abs() < 0.01, "{clip}");
    }
    let log = desk.read_text("out/serial.log");
    let (asked, said) = (log.matches(" act0 > ").count(), log.matches(" act0 < ").count());
    assert!(asked > 3_000 && said > 12_000, "{asked} {said}");
    for motion in ["stand", "drive", "walk"] {
        let plan = format!("out/plans/{motion}.json");
        desk.run(&["report", &plan])
            .succeeds_with(0, &["consistent: no residual exceeds its tolerance"]);
    }
}

/// Arms a robot and plays motions.
fn played(desk: &Desk, bus: &str, motions: &[&str]) {
    in_time(desk, bus, &[&["send", "--arm"], motions].concat()).succeeds();
}

#[test]
fn in_real_time_a_controller_plays_motors_at_the_other_end_of_a_serial_line() {
    let desk = desk_with_shipped_files();
    let args = ["library", "build", "motions/pup_library.toml", "-o", "pup.rwl"];
    desk.make(&args);
    let bus = format!("sim:{}", desk.path("robot.sock").display());
    let mut motors = Robot::motors(&desk, ROBOT, "servos", &[]);
    let _controller = Robot::controller(&desk, ROBOT, &bus, "servos");
    on(&desk, &bus, &["flash", "pup.rwl", "--robot", ROBOT]).succeeds();
    on(&desk, &bus, &["gains", "feed-forward", "0"]).succeeds();
    played(&desk, &bus, &["walk", "drive", "stand"]);

    // Without its servos, a robot cannot be armed.
    motors.stop();
    assert!(desk.path("servos").symlink_metadata().is_err(), "the line is gone");
    let lost = "✗ the robot is stopped: the serial adapter of the servos is gone";
    let doctor = within(&format!("{lost:?} of doctor"), || {
        let doctor = on(&desk, &bus, &["doctor"]);
        doctor.stdout.contains(lost).then_some(doctor)
    });
    let refused = on(&desk, &bus, &["send", "--arm", "stand"]);
    assert_ne!(refused.code, 0, "{}", refused.stdout);

    // The message names the cause: no button was pressed, and there is no CAN.
    assert_eq!(doctor.code, 5, "{}", doctor.stderr);
    let said = doctor.stdout;
    for words in ["plug the adapter in again", "the serial adapter of the servos was lost (bus 0)"]
    {
        assert!(said.contains(words), "{words}: {said}");
    }
    for word in ["emergency", "CAN_H", "terminat", "candump", "a bus is off"] {
        assert!(!said.contains(word), "{word}: {said}");
    }
}

#[test]
fn in_real_time_a_robot_on_the_ground_is_carried_by_motors_at_a_serial_line() {
    let desk = desk_with_shipped_files();
    let args = ["library", "build", "motions/pup_library.toml", "-o", "pup.rwl"];
    desk.make(&args);
    let bus = format!("sim:{}", desk.path("robot.sock").display());
    let on_ground = ["--on", "ground", "--world-log", "world.csv"];
    let mut motors = Robot::motors(&desk, ROBOT, "servos", &on_ground);
    let _controller = Robot::controller(&desk, ROBOT, &bus, "servos");
    on(&desk, &bus, &["flash", "pup.rwl", "--robot", ROBOT]).succeeds();
    // The hoist releases the robot while it stands.
    played(&desk, &bus, &["stand:2", "drive"]);
    motors.stop();
    let log = desk.read_text("world.csv");
    let mut lines = log.lines().map(|line| line.split(',').collect::<Vec<_>>());
    let heading = lines.next().unwrap();
    let column = |name| heading.iter().position(|cell| *cell == name).unwrap();
    let (held, fell, com) = (column("held"), column("fell"), column("com_x_m"));
    let rows: Vec<_> = lines.collect();
    let on_ground = rows.split(|row| row[held] == "1").filter(|rows| !rows.is_empty());
    let com_m = |row: &[&str]| row[com].parse::<f64>().unwrap();
    // Each release is measured separately: on a busy computer the robot is armed again, and slides back a little as it sinks.
    let way_m = |free: &[Vec<&str>]| {
        assert!(free.iter().all(|row| row[fell] == "0"), "it fell");
        free.iter().map(|row| com_m(row)).fold(f64::MIN, f64::max) - com_m(&free[0])
    };
    let farthest_m = on_ground.map(way_m).fold(f64::MIN, f64::max);
    assert!(farthest_m > 0.27, "{farthest_m} m");
}

/// Replaces Pup's Dynamixel servos by Feetech servos, which are slower and have no watchdog.
fn with_feetech_servos(pup: &str) -> String {
    let (before, rest) = pup.split_once("[[bus]]").expect("Pup has a line of servos");
    let (_, links) = rest.split_once("[[link]]").expect("links follow");
    let before = before.replace("speed_max_rad_s = 8.09", "speed_max_rad_s = 4.2");
    let bus = "[[bus]]\nnumber = 0\nprotocol = \"feetech\"\nmodel = \"STS3215-C018\"\n\
               bit_rate = 1_000_000\nreturn_delay_us = 0\n\n";
    format!("{before}{bus}[[link]]{links}")
}

#[test]
fn in_real_time_feetech_servos_are_played_over_a_serial_line() {
    let desk = desk_with_shipped_files();
    fs::write(desk.path(ROBOT), with_feetech_servos(&desk.read_text(ROBOT))).unwrap();
    // Two packets of set-points, a query and twelve answers: 240 bytes of ten bits at 1 Mbit/s, 120 times per second.
    let checked = desk.run(&["robot", "check", ROBOT]);
    let warning = "warning: bus 0: its drives (STS3215-C018) have no watchdog";
    assert!(checked.stderr.contains(warning), "{}", checked.stderr);
    let warning =
        "warning: actuator XL330-M288-T (5 V) is on bus 0 with `model = \"STS3215-C018\"` (12 V)";
    assert!(checked.stderr.contains(warning), "{}", checked.stderr);
    checked.succeeds_with(0, &["STS3215-C018", "29 %"]);
    let library = "name = \"sts\"\nrobot = \"../robots/pup.toml\"\nsafe = \"stand\"\n\n\
                   [[motion]]\nname = \"stand\"\nfile = \"pup_stand.toml\"\ncode = 1\n";
    fs::write(desk.path("motions/sts_library.toml"), library).unwrap();
    desk.run(&["library", "build", "motions/sts_library.toml", "-o", "sts.rwl"]).succeeds();
    let bus = format!("sim:{}", desk.path("robot.sock").display());
    let _motors = Robot::motors(&desk, ROBOT, "servos", &[]);
    let _controller = Robot::controller(&desk, ROBOT, &bus, "servos");
    on(&desk, &bus, &["flash", "sts.rwl", "--robot", ROBOT]).succeeds();
    played(&desk, &bus, &["stand"]);
}

#[test]
fn a_line_of_servos_is_no_bus_of_frames() {
    let desk = desk_with_shipped_files();
    let says = |args: &[&str], words: &[&str]| {
        let mut command = Command::new(env!("CARGO_BIN_EXE_rollwalk-sim-under-test"));
        command.current_dir(desk.path("")).env("COLUMNS", "1000").env("NO_COLOR", "1").args(args);
        program::run(&mut command, PLAYED).fails(1, words);
    };
    let only = ["--only", "controller", "--bus", "sim:x.sock", "--actuators"];
    let with = |robot, name| [&[robot], &only[..], &[name]].concat();
    says(&with(ROBOT, "can:can0"), &["bus 0 of pup is a serial line (XL330-M288)", "tty:"]);
    says(&with(ROBOT, "tty:/dev/ttyNONE"), &["no device `/dev/ttyNONE`"]);
    says(
        &[ROBOT, "--bus", "sim:x.sock", "--actuators", "tty:/dev/ttyNONE"],
        &["cannot share a serial line", "--only motors --actuators pty:"],
    );
    on(&desk, "tty:/dev/ttyUSB0", &["discover"])
        .fails(1, &["a serial line of servos", "serial:DEVICE"]);
}

/// Checks that a wrong bus of actuators is refused with the name that the robot needs.
#[test]
fn a_device_is_named_with_the_kind_of_bus_that_servos_need() {
    let desk = desk_with_shipped_files();
    let with = |robot, actuators: &[&str], more: &[&str]| {
        let named = actuators.iter().flat_map(|bus| ["--actuators", bus]);
        let args = [robot, "--only", "controller", "--bus", "sim:robot.sock"].into_iter();
        let args: Vec<_> = args.chain(named).chain(more.iter().copied()).collect();
        Robot::refuses(&desk, &args)
    };
    let (pup, agilebot) = ("robots/pup.toml", "robots/agilebot.toml");
    with(pup, &["/dev/ttyACM3"], &[]).fails(2, &["give tty:/dev/ttyACM3 for servos on a serial"]);
    with(pup, &["serial:/dev/ttyACM3"], &[]).fails(1, &["such as tty:/dev/ttyACM3"]);
    with(agilebot, &["can:can1", "can:can2"], &["--log", "bus.log"])
        .fails(1, &["rollwalk monitor --bus sim:robot.sock --log bus.log"]);
}
