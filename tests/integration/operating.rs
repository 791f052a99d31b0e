//! The tools and a simulated robot on this computer's socket: what a maker without CAN does first.

use crate::desk_with_shipped_files;
use rollwalk_tests::{Desk, Outcome};
use std::process::{Child, Command, Stdio};
use std::thread::sleep;
use std::time::{Duration, Instant};

/// A simulated robot; switched off when dropped.
struct Robot(Child);

impl Robot {
    fn start(desk: &Desk, bus: &str) -> Self {
        let mut command = Command::new(env!("CARGO_BIN_EXE_rollwalk-sim-under-test"));
        command.arg(desk.path("robots/legbot.toml")).args(["--bus", bus]);
        let robot = Self(command.stderr(Stdio::null()).spawn().expect("the robot starts"));
        let start = Instant::now();
        while !desk.path("robot.sock").exists() {
            assert!(start.elapsed() < Duration::from_secs(60), "the robot makes no socket");
            sleep(Duration::from_millis(10));
        }
        robot
    }
}

impl Drop for Robot {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

/// A command of ours on `bus`.
fn on(desk: &Desk, bus: &str, args: &[&str]) -> Outcome {
    let mut command = desk.command(args);
    command.env("ROLLWALK_BUS", bus).env("XDG_CACHE_HOME", desk.path("cache"));
    command.output().expect("the command starts").into()
}

#[test]
fn a_library_is_built_flashed_and_played_by_name_and_the_robot_is_stopped_and_cleared() {
    let desk = desk_with_shipped_files();
    desk.write(
        "legbot.toml",
        "name = \"legbot\"\nrobot = \"robots/legbot.toml\"\nsafe = \"stand\"\n\
         [[motion]]\nname = \"stand\"\nfile = \"stand.toml\"\ncode = 1\n\
         [[motion]]\nname = \"rest\"\nfile = \"rest.toml\"\ncode = 2\n[via_safe]\nduration_s = 0.5\n",
    );
    for (name, duration) in [("stand", "0.5"), ("rest", "0.6")] {
        desk.write(
            &format!("{name}.toml"),
            format!(
                "name = \"{name}\"\nrobot = \"robots/legbot.toml\"\nends = \"at_rest\"\n\
                 duration_s = {duration}\n[footfalls]\nall = \"stance\"\n"
            ),
        );
    }
    let socket = format!("sim:{}", desk.path("robot.sock").display());
    let run = |args: &[&str]| on(&desk, &socket, args);
    run(&["library", "build", "legbot.toml", "-o", "legbot.rwl"]).succeeds();
    let nobody = run(&["discover"]);
    nobody.fails(1, &["no simulated robot", "rollwalk-sim ROBOT.toml --bus sim:"]);

    let robot = Robot::start(&desk, &socket);
    assert!(run(&["discover", "--json"]).succeeds().contains("\"library\": null"));
    run(&["send", "--arm", "1"]).fails(1, &["no motion library", "rollwalk flash"]);
    run(&["doctor"]).succeeds_with(5, &["it needs a library: rollwalk flash LIB.rwl"]);
    let flashed = run(&["flash", "legbot.rwl"]).succeeds();
    assert!(flashed.contains("legbot has library"), "{flashed}");
    run(&["send", "rest"]).fails(5, &["torque is off; arm first", "rollwalk doctor"]);
    run(&["send", "--arm", "run"]).fails(1, &["no motion `run`", "it has stand, rest"]);
    run(&["send", "--arm", "rest", "--speed", "2"]).fails(2, &["from 0.016 (1/64) to 1"]);
    run(&["send", "--arm", "rest", "1"]).succeeds();
    run(&["doctor"]).succeeds_with(0, &["nothing bars it from being armed"]);

    run(&["gains", "set", "all", "--kp", "12.5"]).succeeds();
    assert!(run(&["gains", "show", "--json"]).succeeds().contains("12.5"));
    run(&["gains", "set", "nose", "--kp", "1"]).fails(1, &["no joint or wheel `nose`"]);
    run(&["gains", "set", "0", "--kp=-1"]).fails(5, &["the value is no number, or beyond"]);

    run(&["estop"]).succeeds();
    run(&["send", "--arm", "rest"]).fails(5, &["refused to arm"]);
    run(&["doctor"])
        .succeeds_with(5, &["stopped by an emergency stop", "rollwalk clear --bus sim:"]);
    run(&["clear"]).succeeds();
    run(&["clear"]).succeeds();
    run(&["send", "--arm", "2"]).succeeds();

    run(&["monitor", "--for", "0.3", "--log", "run.log", "--mcap", "run.mcap"]).succeeds();
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
    on(&desk, "can1", &["doctor"]).fails(2, &["`can1` is no bus", "such as can:can0"]);
    on(&desk, "serial:/dev/ttyNONE", &["doctor"]).fails(1, &["no device `/dev/ttyNONE`"]);
    on(&desk, "slcan:/dev/null@123", &["doctor"]).fails(1, &["bitrate of 123 bit/s", "kbit/s"]);
    on(&desk, "sim", &["doctor", "--node", "15"]).fails(2, &["a number from 0 to 14"]);
}
