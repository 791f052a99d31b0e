//! Tests of steering from the command line over a simulated bus, and of requests that `rollwalk drive` refuses.

use crate::desk_with_shipped_files;
use crate::simulated::{Robot, desk_with_library_file, in_time, on};

#[test]
fn what_cannot_be_driven_is_refused_before_anything_is_sent() {
    let desk = desk_with_shipped_files();
    desk.make(&["library", "build", "motions/agilebot_library.toml", "-o", "a.rwl"]);
    desk.make(&["plan", "motions/walk.toml", "-o", "walk.json"]);
    desk.make(&["plan", "motions/drive_1m.toml", "-o", "drive.json"]);
    desk.make(&["plan", "motions/legbot_walk.toml", "-o", "legbot.json"]);
    let steer = ["--steer", "1:0.1,0,0", "--until", "2"];
    let run = |args: &[&str]| on(&desk, "sim:none.sock", &[&["drive"], args].concat());
    run(&["a.rwl"]).fails(1, &["by keys requires a terminal", "--steer AT:FORWARD,LEFT,TURN"]);
    let with = |gait: &str| run(&[&["a.rwl", "--gait", gait][..], &steer].concat());
    with("legbot.json")
        .fails(1, &["was planned for robot `legbot`", "a.rwl is for robot `agilebot`"]);
    with("drive.json").fails(1, &["`drive_1m` has ends", "does not repeat"]);
    with("none.json").fails(1, &["none.json"]);
    with("walk.json").fails(1, &["no simulated robot"]);
    run(&["motions/walk.toml", "--steer", "1:0,0,0", "--until", "2"])
        .fails(1, &["walk.toml", "motion file"]);
    let order = ["a.rwl", "--steer", "2:0,0,0", "--steer", "1:0,0,0", "--until", "3"];
    run(&order).fails(1, &["--steer at 1 s is given after --steer at 2 s", "in order of time"]);
    run(&["a.rwl", "--steer", "1:0.1,0"]).fails(2, &["AT:FORWARD,LEFT,TURN", "1:0.1,0"]);
    run(&["a.rwl", "--steer", "1:0,0,0"]).fails(2, &["--until"]);
}

/// Tests that two robots are refused: LegBot, which needs a gait because its wheels are fixed to its links, and a stopped
/// robot, which must be cleared first.
#[test]
fn a_robot_that_cannot_be_steered_as_it_is_is_refused_at_once() {
    let desk = desk_with_library_file();
    desk.make(&["library", "build", "legbot.toml", "-o", "legbot.rwl"]);
    desk.make(&["plan", "motions/legbot_walk.toml", "-o", "walk.json"]);
    let bus = format!("sim:{}", desk.path("robot.sock").display());
    let _robot = Robot::start(&desk, &bus);
    let drive = ["drive", "legbot.rwl", "--steer", "1:0.05,0,0", "--until", "3"];
    on(&desk, &bus, &drive)
        .fails(1, &["legbot cannot drive without a gait", "do not roll", "--gait PLAN.json"]);
    on(&desk, &bus, &["flash", "legbot.rwl"]).succeeds();
    on(&desk, &bus, &["estop"]).succeeds();
    on(&desk, &bus, &[&drive[..], &["--gait", "walk.json"]].concat())
        .fails(5, &["nothing was planned", "type `rollwalk clear` before arming it"]);
}

/// Tests steering on the ground, then the return to SAFE.
#[test]
fn in_real_time_a_robot_is_steered_by_a_list_and_disarmed() {
    let desk = desk_with_shipped_files();
    let socket = format!("sim:{}", desk.path("robot.sock").display());
    desk.make(&["library", "build", "motions/agilebot_library.toml", "-o", "a.rwl"]);
    let robot = Robot::on_ground(&desk, "robots/agilebot.toml", &socket);
    on(&desk, &socket, &["flash", "a.rwl"]).succeeds();
    let steer =
        ["drive", "a.rwl", "--steer", "0.5:0.2,0,0", "--steer", "2.5:0,0,0", "--until", "3"];
    let driven = in_time(&desk, &socket, &steer);
    assert!(driven.stderr.contains("0 rejected"), "{}", driven.stderr);
    assert!(driven.stderr.contains("the robot is disarmed"), "{}", driven.stderr);
    let told = driven.succeeds();
    assert!(told.lines().any(|line| line.contains("steered forward 0.20")), "{told}");
    drop(robot);
}

/// Tests a simulated drive over a kerb, on the map of its file and on a sensed one.
#[test]
fn a_simulated_robot_is_steered_over_terrain() {
    let desk = desk_with_shipped_files();
    desk.make(&["library", "build", "motions/agilebot_library.toml", "-o", "a.rwl"]);
    desk.write("kerb.toml", "[step]\nat_x_m = 0.4\nheight_m = 0.015\n");
    let steer = ["drive", "a.rwl", "--steer", "0.2:0.2,0,0", "--until", "3"];
    let drive = |more: &[&str]| desk.run(&[&steer[..], more].concat());
    drive(&[]).fails(1, &["there is no bus to the robot", "--terrain TERRAIN.toml"]);
    drive(&["--terrain", "kerb.toml", "--sensed", "5"]).fails(2, &["NOISE,HOLES,DELAY"]);
    drive(&["--terrain", "none.toml"]).fails(1, &["there is no terrain file"]);
    drive(&["--terrain", "kerb.toml", "--bus", "sim"]).fails(1, &["--bus is given, too"]);
    desk.write(
        "crate.toml",
        "[[obstacle]]\nname = \"crate\"\nbox_m = [0.3, 0.3, 0.3]\nat_m = [0.6, 0, 0.15]\n",
    );
    drive(&["--terrain", "crate.toml"]).succeeds_with(3, &["touches obstacle `crate`"]);
    for map in [&[][..], &["--sensed"], &["--sensed", "2,10,300"]] {
        let told = drive(&[&["--terrain", "kerb.toml"][..], map].concat()).succeeds();
        assert!(told.contains("kerb.toml: the robot did not fall in 3.0 s"), "{told}");
        let ahead = told.split("it moved ").nth(1).and_then(|rest| rest.split(' ').next());
        let ahead_m: f64 = ahead.and_then(|ahead| ahead.parse().ok()).expect("a distance");
        // It speeds up in the first half second.
        assert!((0.45..0.57).contains(&ahead_m), "{told}");
    }
}
