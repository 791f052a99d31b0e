//! Tests of link shapes in robot files.

use super::*;
use nalgebra::Vector3;
use rollwalk_robot::shape::{DEFAULT_CLEARANCE_MARGIN_M, Shape};

const BODY: &str = "inertia_in_link_kg_m2 = [0.01, 0.02, 0.02, 0.0, 0.0, 0.0]";
const SHANK: &str =
    "parts = [{ mass_kg = 0.1, at_m = [0.0, 0.01, -0.1], box_m = [0.02, 0.02, 0.2] }]";

#[track_caller]
fn assert_shape_fault(link: &str, shape: &str, message: &str, help: &str) {
    let to = format!("{link}\nshapes = [{shape}]");
    assert_fault(link, &to, "shapes", message, help);
}

#[test]
fn shapes_are_read_and_mirrored() {
    assert!(tiny().links.iter().all(|link| link.shapes.is_empty()));
    assert_eq!(tiny().clearance_margin_m, DEFAULT_CLEARANCE_MARGIN_M);
    let box_m = "{ at_m = [0.1, 0.0, 0.0], box_m = [0.3, 0.2, 0.1] }";
    let capsule = "{ from_m = [0.0, 0.01, 0.0], to_m = [0.0, 0.01, -0.2], radius_m = 0.02 }";
    let text = ROBOT
        .replacen(BODY, &format!("{BODY}\nshapes = [{box_m}, {capsule}]"), 1)
        .replacen(SHANK, &format!("{SHANK}\nshapes = [{capsule}]"), 1)
        .replacen("name = \"tiny\"", "name = \"tiny\"\nclearance_margin_m = 0.003", 1);
    let robot = Robot::from_toml("tiny.toml", &text).unwrap();
    assert_eq!(robot.clearance_margin_m, 0.003);
    let center_in_link_m = Vector3::new(0.1, 0.0, 0.0);
    let size_m = Vector3::new(0.3, 0.2, 0.1);
    assert_eq!(robot.links[0].shapes[0], Shape::Box { center_in_link_m, size_m });
    let leg = |side: f64| Shape::Capsule {
        from_in_link_m: Vector3::new(0.0, side * 0.01, 0.0),
        to_in_link_m: Vector3::new(0.0, side * 0.01, -0.2),
        radius_m: 0.02,
    };
    assert_eq!(robot.links[2].shapes, [leg(1.0)]);
    assert_eq!(robot.links[3].shapes, [leg(-1.0)]);
    // Hips connect both shanks with the body, so only the shanks need clearance.
    let pairs: Vec<_> = robot.clearance_pairs().map(|pair| pair.links).collect();
    assert_eq!(pairs, [[2, 3]]);
    // The arm of the tiny robot has no shape, so hash and channels are equal.
    assert_eq!(robot.controller_config().unwrap(), tiny().controller_config().unwrap());
    let json = serde_json::to_string(&robot).unwrap();
    assert_eq!(serde_json::from_str::<Robot>(&json).unwrap(), robot);
    let json = serde_json::to_string(&tiny()).unwrap();
    assert!(!json.contains("shapes") && !json.contains("clearance"), "{json}");
}

#[test]
fn shapes_that_are_none() {
    let capsule = |radius: &str, end: &str| {
        format!("{{ from_m = [0.0, 0.0, 0.0], to_m = [0.0, 0.0, {end}], radius_m = {radius} }}")
    };
    let check = |shape: &str, message: &str, help: &str| {
        assert_shape_fault(SHANK, shape, message, help);
    };
    check(&capsule("0.0", "-0.2"), "`shapes` [0].radius_m is 0 m", "above 0 to 1 m");
    check(&capsule("20.0", "-0.2"), "`shapes` [0].radius_m is 20 m", "above 0 to 1 m");
    check(&capsule("0.02", "-200.0"), "`shapes` [0].to_m is [0, 0, -200]", "within ±10 m");
    check("{ from_m = [0, 0, 0], radius_m = 0.1 }", "`to_m` is missing", "array of 3");
    check("{ radius_m = 0.1, box_m = [1, 1, 1] }", "`shape` must be given once", "`from_m`");
    check("{ at_m = [0, 0, 0], box_m = [0.1, 0.1, -1] }", "`box_m` [2] is -1 m", "above 0");
    check("{ at_m = [0, 0, 0], box_m = [0.1, 0.1, 0.1] }", "[0].box_m is a box", "capsule");
    let many = vec![capsule("0.02", "-0.2"); 17].join(", ");
    check(&many, "has 17 entries", "at most 16");
    let found = faults("name = \"tiny\"", "name = \"tiny\"\nclearance_margin_m = -0.01");
    assert_eq!(found.len(), 1, "{found:?}");
    let (line, message, help) = &found[0];
    assert_eq!((*line, message.as_str()), (2, "the robot: `clearance_margin_m` is -0.01 m"));
    assert_eq!(help, "give a value from 0 to 1 m");
}
