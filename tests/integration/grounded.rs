//! The robot on the simulated ground: a plan by itself, and a library behind the bus.

use crate::desk_with_shipped_files;
use crate::simulated::{Robot, on};

#[test]
fn a_plan_is_played_on_the_ground_and_compared_with_what_becomes_of_it() {
    let desk = desk_with_shipped_files();
    desk.run(&["plan", "motions/drive_1m.toml", "-o", "drive.json"]).succeeds();
    let said = desk.run(&["simulate", "drive.json"]).succeeds();
    assert!(said.contains("forward: 1.000 of the plan") && said.contains("it holds"), "{said}");
    let said = desk.run(&["simulate", "drive.json", "--json", "--rate", "60"]).succeeds();
    assert!(said.contains("\"holds\": true") && said.contains("\"fell_at_s\": null"), "{said}");
    // It slides down a roof.
    desk.run(&["simulate", "drive.json", "--slope", "40"]).succeeds_with(3, &["it fell after"]);
    desk.run(&["simulate", "drive.json", "--slope", "60"])
        .fails(1, &["--slope is 60: it must be from -45 to 45 degrees"]);
}

#[test]
fn a_robot_on_the_ground_tells_how_far_it_went() {
    let desk = desk_with_shipped_files();
    desk.write(
        "drive.toml",
        "name = \"drive\"\nrobot = \"robots/agilebot.toml\"\nsafe = \"stand\"\n\
         [[motion]]\nname = \"stand\"\nfile = \"motions/stand.toml\"\ncode = 1\n\
         [[motion]]\nname = \"drive_1m\"\nfile = \"motions/drive_1m.toml\"\ncode = 2\n\
         [via_safe]\nduration_s = 1.2\nsamples = 25\n",
    );
    desk.run(&["library", "build", "drive.toml", "-o", "drive.rwl"]).succeeds();
    let bus = format!("sim:{}", desk.path("robot.sock").display());
    Robot::refuses(
        &desk,
        &["robots/agilebot.toml", "--bus", &bus, "--on", "stand", "--slope", "3"],
    )
    .fails(1, &["--slope is for --on ground"]);
    let robot = ["robots/agilebot.toml", "--on", "ground"];
    let mut robot = Robot::heard(&desk, &robot, &bus, "said.txt");
    on(&desk, &bus, &["flash", "drive.rwl"]).succeeds();
    on(&desk, &bus, &["send", "--arm", "drive_1m"]).succeeds();
    robot.stop();
    let said = desk.read_text("said.txt");
    let line = said.lines().find(|line| line.contains("drive_1m:")).expect(&said);
    let words: Vec<&str> = line.split_whitespace().collect();
    let ahead: f64 =
        words[words.iter().position(|word| *word == "ahead,").unwrap() - 2].parse().unwrap();
    assert!((0.97..1.03).contains(&ahead), "{line}");
    assert!(!said.contains("fell"), "{said}");
}
