//! Tests of robots whose knees have belts, or cranks and rods, from motors in the body: plan, library behind the bus, tracking
//! and exports.

use crate::desk_with_shipped_files;
use serde_json::Value;

const LIBRARY: &str = "name = \"legs\"\nrobot = \"robots/ROBOT.toml\"\nsafe = \"stand\"\n\
    [[motion]]\nname = \"stand\"\nfile = \"stand.toml\"\ncode = 1\n\
    [[motion]]\nname = \"walk\"\nfile = \"motions/ROBOT_walk.toml\"\ncode = 2\n\
    [via_safe]\nduration_s = 1.2\nsamples = 25\n";

/// Builds a library of a robot's stand and walk, plays it on the ground behind the bus, and tracks the walk. Returns the MuJoCo
/// model of the walk.
fn walked(robot: &str) -> String {
    let desk = desk_with_shipped_files();
    let stand = desk.read_text("motions/pup_stand.toml");
    desk.write("stand.toml", stand.replace("../robots/pup", &format!("robots/{robot}")));
    desk.write("legs.toml", LIBRARY.replace("ROBOT", robot));
    desk.run(&["library", "build", "legs.toml", "-o", "legs.rwl"]).succeeds();
    let said = desk.run(&["simulate", "legs.rwl", "--json"]).succeeds();
    let said: Value = serde_json::from_str(&said).unwrap();
    assert_eq!(said["falls"], Value::Array(Vec::new()));
    let travels = said["travels"].as_array().unwrap();
    let walk = travels.iter().find(|travel| travel["name"] == "walk").unwrap();
    // Five periods of 80 mm.
    let ahead_m = walk["forward_m"].as_f64().unwrap();
    assert!((0.38..0.42).contains(&ahead_m), "{ahead_m}");

    desk.make(&["plan", &format!("motions/{robot}_walk.toml"), "-o", "walk.json"]);
    desk.run(&["simulate", "walk.json", "--tracking"]).succeeds();
    desk.run(&["retarget", "walk.json", "-o", "corrected.json"])
        .fails(1, &["the motor of joint `front_left_knee` is coupled"]);
    desk.run(&["export", "walk.json", "-o", "walk.xml"]).succeeds();
    desk.read_text("walk.xml")
}

#[test]
fn a_robot_with_belts_walks_behind_the_bus_and_tracked() {
    let model = walked("pup_belt");
    assert_eq!(model.matches("<fixed name=\"").count(), 4);
    assert_eq!(model.matches("tendon=\"front_left_knee\"").count(), 1);
}

#[test]
fn a_robot_with_five_bar_legs_walks_behind_the_bus_and_tracked() {
    let model = walked("pup_five_bar");
    assert_eq!(model.matches("<spatial name=\"").count(), 4);
    assert_eq!(model.matches("tendon1=\"front_left_knee_rod\"").count(), 1);
}
