//! Test of a robot whose knees have belts from motors in the body: plan, library behind the bus, tracking and exports.

use crate::desk_with_shipped_files;
use serde_json::Value;

const LIBRARY: &str = "name = \"belts\"\nrobot = \"robots/pup_belt.toml\"\nsafe = \"stand\"\n\
    [[motion]]\nname = \"stand\"\nfile = \"stand.toml\"\ncode = 1\n\
    [[motion]]\nname = \"walk\"\nfile = \"motions/pup_belt_walk.toml\"\ncode = 2\n\
    [via_safe]\nduration_s = 1.2\nsamples = 25\n";

#[test]
fn a_robot_with_belts_walks_behind_the_bus_and_tracked() {
    let desk = desk_with_shipped_files();
    let stand = desk.read_text("motions/pup_stand.toml");
    desk.write("stand.toml", stand.replace("../robots/pup.toml", "robots/pup_belt.toml"));
    desk.write("belts.toml", LIBRARY);
    desk.run(&["library", "build", "belts.toml", "-o", "belts.rwl"]).succeeds();
    let said = desk.run(&["simulate", "belts.rwl", "--json"]).succeeds();
    let said: Value = serde_json::from_str(&said).unwrap();
    assert_eq!(said["falls"], Value::Array(Vec::new()));
    let travels = said["travels"].as_array().unwrap();
    let walk = travels.iter().find(|travel| travel["name"] == "walk").unwrap();
    // Five periods of 80 mm.
    let ahead_m = walk["forward_m"].as_f64().unwrap();
    assert!((0.38..0.42).contains(&ahead_m), "{ahead_m}");

    desk.make(&["plan", "motions/pup_belt_walk.toml", "-o", "walk.json"]);
    desk.run(&["simulate", "walk.json", "--tracking"]).succeeds();
    desk.run(&["retarget", "walk.json", "-o", "corrected.json"])
        .fails(1, &["the motor of joint `front_left_knee` turns several joints"]);
    desk.run(&["export", "walk.json", "-o", "walk.xml"]).succeeds();
    let model = desk.read_text("walk.xml");
    assert_eq!(model.matches("<fixed name=\"").count(), 4);
    assert_eq!(model.matches("tendon=\"front_left_knee\"").count(), 1);
}
