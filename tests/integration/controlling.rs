//! Tests of closed-loop control from the command line over a simulated bus, and of requests that `rollwalk control` refuses.

use crate::desk_with_shipped_files;
use crate::simulated::{Robot, in_time, on};

/// String in the planner's output for each motion.
const PLANNING: &str = "iterations";

#[test]
fn what_cannot_be_controlled_is_refused_before_anything_is_sent() {
    let desk = desk_with_shipped_files();
    desk.make(&["plan", "motions/drive_1m.toml", "-o", "drive.json"]);
    let library = "motions/agilebot_library.toml";
    let run = |args: &[&str]| on(&desk, "sim:none.sock", &[&["control"], args].concat());
    desk.run(&["control", library, "--play", "walk"]).fails(1, &["--bus is missing", "--bus"]);
    run(&[library]).fails(1, &["no motion to play", "--play walk:5"]);
    run(&[library, "--play", "run"]).fails(1, &["no motion `run`", "drive_1m", "walk"]);
    run(&[library, "--play", "walk:0"]).fails(2, &["walk:0", "MOTION:CYCLES"]);
    run(&[library, "--play", "walk", "--rate", "961"]).fails(1, &["60 to 960 samples/s"]);
    run(&[library, "--play", "walk", "--latency-ms", "3"]).fails(1, &["latency is measured"]);
    run(&["drive.json", "--play", "walk"]).fails(1, &["drive.json is a plan"]);
    run(&["none.toml", "--play", "walk"]).fails(1, &["none.toml"]);
    run(&["motions/walk.toml", "--play", "walk"]).fails(1, &["walk.toml", "motion file"]);
    run(&["motions/pup_library.toml", "--play", "walk"]).fails(1, &["does not accept torques"]);
    run(&["motions/swizzlebot_library.toml", "--play", "forward"]).fails(1, &["turns freely"]);
    let alone = run(&[library, "--play", "walk"]);
    assert!(!alone.stderr.contains(PLANNING), "{}", alone.stderr);
    alone.fails(1, &["no simulated robot"]);
}

/// Tests that a robot with another library is refused; then that the robot walks on the ground and returns to SAFE.
#[test]
fn in_real_time_a_robot_walks_in_closed_loop_and_is_disarmed() {
    let desk = desk_with_shipped_files();
    let socket = format!("sim:{}", desk.path("robot.sock").display());
    let library = "motions/agilebot_library.toml";
    desk.make(&["library", "build", library, "-o", "a.rwl"]);
    let robot = Robot::on_ground(&desk, "robots/agilebot.toml", &socket);
    let control = ["control", library, "--play", "walk"];
    on(&desk, &socket, &control).fails(5, &["another library"]);
    on(&desk, &socket, &["flash", "a.rwl"]).succeeds();
    let controlled = in_time(&desk, &socket, &control);
    let said = &controlled.stderr;
    assert!(
        said.contains("all motions were played")
            && said.contains("the state of the robot is estimated"),
        "{said}"
    );
    assert!(said.contains("the robot is disarmed") && said.contains(PLANNING), "{said}");
    controlled.succeeds();
    drop(robot);
}
