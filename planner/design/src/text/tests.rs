//! Tests of parameters of every kind in robot files.

use super::*;
use crate::catalog::Catalog;
use crate::parameter::Axis;
use rollwalk_robot::{Contact, Robot};

const AGILEBOT: &str = include_str!("../../../../shipped/robots/agilebot.toml");

fn agilebot() -> RobotText {
    RobotText::new(AGILEBOT).unwrap()
}

fn location(kind: Kind, template: Option<&str>, name: &str, axis: Option<Axis>) -> Location {
    let template = template.map(str::to_owned);
    Location { kind, template, name: name.to_owned(), axis, limbs: Vec::new() }
}

fn read(text: &RobotText) -> Robot {
    Robot::from_toml("changed", &text.to_string()).unwrap()
}

#[test]
fn a_longer_link_carries_what_is_along_it() {
    let mut text = RobotText::new(&AGILEBOT.replace(", stretches = true", "")).unwrap();
    let before = read(&text);
    let thigh = location(Kind::Length, Some("leg"), "*_thigh", None);
    assert_eq!(text.value(&thigh), Ok(0.12));
    text.set(&thigh, 0.15).unwrap();
    assert!((text.value(&thigh).unwrap() - 0.15).abs() < 1e-12);
    let after = read(&text);
    for (before, after) in before.joints.iter().zip(&after.joints) {
        let [from, to] = [before, after].map(|joint| joint.parent_from_joint.translation.vector);
        let grown = if before.name.ends_with("knee") {
            Vector3::new(0.0, 0.0, -0.03)
        } else {
            Vector3::zeros()
        };
        assert!((to - from - grown).norm() < 1e-12, "{}", before.name);
    }
    for (before, after) in before.links.iter().zip(&after.links) {
        let is_thigh = before.name.ends_with("thigh");
        assert_eq!(before.mass_kg, after.mass_kg, "nothing of it stretches");
        let share = if is_thigh { 1.25 } else { 1.0 };
        assert!((after.com_in_link_m.z - share * before.com_in_link_m.z).abs() < 1e-12);
        assert_eq!(before.com_in_link_m.y, after.com_in_link_m.y);
    }
}

#[test]
fn a_part_that_stretches_grows_in_mass_and_size() {
    let mut text = agilebot();
    text.set(&location(Kind::Length, Some("leg"), "*_thigh", None), 0.18).unwrap();
    let text = text.to_string();
    assert!(text.contains("mass_kg = 0.09"), "{text}");
    assert!(text.contains("box_m = [0.03, 0.04, 0.15]"), "{text}");
}

#[test]
fn mounts_move_apart_on_all_sides() {
    let mut text = agilebot();
    let track = location(Kind::Mount, None, "leg", Some(Axis::Y));
    assert_eq!(text.value(&track), Ok(0.08));
    text.set(&track, 0.1).unwrap();
    for joint in read(&text).joints.iter().filter(|joint| joint.parent == 0) {
        let side = if joint.name.contains("left") { 0.1 } else { -0.1 };
        assert!((joint.parent_from_joint.translation.y - side).abs() < 1e-12);
    }
}

#[test]
fn every_kind_sets_what_it_reads_and_leaves_the_rest_of_the_file() {
    let places = [
        location(Kind::Length, Some("leg"), "*_shank", None),
        location(Kind::Joint, Some("leg"), "*_hip_pitch", Some(Axis::Y)),
        location(Kind::Mount, None, "leg", Some(Axis::X)),
        location(Kind::Center, Some("leg"), "*", Some(Axis::X)),
        location(Kind::Radius, Some("leg"), "*", None),
        location(Kind::Tilt, Some("leg"), "*", None),
        location(Kind::Speed, None, "xm540", None),
        location(Kind::Torque, None, "xm540", None),
        location(Kind::Mass, None, "body", None),
    ];
    let original = agilebot().to_string();
    for place in places {
        let mut text = agilebot();
        let before = text.value(&place).unwrap();
        text.set(&place, before).unwrap();
        assert_eq!(read(&text), read(&agilebot()), "{place:?}");
        text.set(&place, before + 0.01).unwrap();
        assert!((text.value(&place).unwrap() - before - 0.01).abs() < 1e-12, "{place:?}");
        assert_ne!(read(&text), read(&agilebot()), "{place:?}");
        let changed = text.to_string();
        let lines = original.lines().zip(changed.lines());
        let comments = |line: &str| line.split_once('#').map(|(_, comment)| comment.to_owned());
        assert!(lines.clone().all(|(one, other)| comments(one) == comments(other)), "{changed}");
        assert_eq!(original.lines().count(), changed.lines().count());
    }
}

#[test]
fn what_is_not_there_is_named_with_what_is() {
    let found = agilebot().value(&location(Kind::Radius, Some("leg"), "wheel", None)).unwrap_err();
    assert_eq!(found.problem, "the robot has no `leg/wheel` to change");
    assert_eq!(found.help, "give one of *");
    let found = agilebot().value(&location(Kind::Speed, None, "xl430", None)).unwrap_err();
    assert_eq!(found.help, "give one of xm430, xm430_drive, xm540");
}

#[test]
fn some_limbs_change_alone_and_share_what_is_theirs() {
    let mut text = agilebot();
    let before = read(&text);
    let front = ["front_left", "front_right"].map(str::to_owned).to_vec();
    let of_front = |name: &str| Location {
        limbs: front.clone(),
        ..location(Kind::Length, Some("leg"), name, None)
    };
    text.set(&of_front("*_thigh"), 0.14).unwrap();
    text.set(&of_front("*_shank"), 0.13).unwrap();
    assert_eq!(text.value(&of_front("*_thigh")), Ok(0.14));
    let rear = location(Kind::Length, Some("leg"), "*_thigh", None);
    assert_eq!(text.value(&rear), Ok(0.12));
    let after = read(&text);
    let length = |robot: &Robot, joint: &str| {
        let joint = robot.joints.iter().find(|of| of.name == joint).unwrap();
        joint.parent_from_joint.translation.vector.norm()
    };
    for (joint, expected) in [
        ("front_left_knee", 0.14),
        ("front_right_knee", 0.14),
        ("rear_left_knee", 0.12),
        ("front_left_steer", 0.13),
        ("rear_right_steer", 0.12),
    ] {
        assert!((length(&after, joint) - expected).abs() < 1e-12, "{joint}");
    }
    let names = |robot: &Robot| -> Vec<String> {
        robot.joints.iter().map(|joint| joint.name.clone()).collect()
    };
    assert_eq!(names(&before), names(&after), "plans and libraries see the same robot");
    let text = text.to_string();
    assert_eq!(text.matches("template = \"leg_front\"").count(), 2);
    assert_eq!(text.matches("[[template.leg_front.joint]]").count(), 4, "one copy");
    let at = |part: &str| text.find(part).unwrap();
    assert!(at("[[template.leg.end_effector]]") < at("[[template.leg_front.link]]"));
    assert!(at("[[template.leg_front.end_effector]]") < at("[[limb]]"));
    assert!(text.contains("# computed: around the parts"), "comments stay");
    let missing = Location { limbs: vec!["middle".into()], ..rear };
    let nothing = RobotText::new(AGILEBOT).unwrap().set(&missing, 0.1).unwrap_err();
    assert_eq!(nothing.problem, "the robot has no limb `middle`");
    assert_eq!(nothing.help, "give one of front_left, front_right, rear_left, rear_right");
}

#[test]
fn a_star_stands_for_all_parts_of_the_robot_that_fit_mirrored_ones_with_the_other_sign() {
    let mut text =
        RobotText::new(include_str!("../../../../shipped/robots/car_tilted.toml")).unwrap();
    let before = read(&text);
    let height = location(Kind::Center, None, "front_*", Some(Axis::Z));
    let track = location(Kind::Center, None, "*", Some(Axis::Y));
    let tilt = location(Kind::Tilt, None, "front_*", None);
    assert_eq!(text.value(&height), Ok(-0.03));
    text.set(&height, -0.04).unwrap();
    text.set(&track, 0.1).unwrap();
    text.set(&tilt, 0.1).unwrap();
    let after = read(&text);
    for (before, after) in before.end_effectors.iter().zip(&after.end_effectors) {
        let front = before.name.starts_with("front");
        let side = before.center_in_link_m.y.signum();
        let expected =
            Vector3::new(before.center_in_link_m.x, 0.1 * side, if front { -0.04 } else { -0.03 });
        assert!((after.center_in_link_m - expected).norm() < 1e-12, "{}", after.name);
        let Contact::ActuatedWheel { axis_in_link: axis, .. } = &after.contact else { panic!() };
        let tilt = if front { 0.1 * side } else { 0.0 };
        assert!((axis.z.atan2(axis.y) - tilt).abs() < 1e-6, "{}", after.name);
    }
    let nothing = text.value(&location(Kind::Radius, None, "middle_*", None)).unwrap_err();
    assert!(nothing.help.contains("front_left"), "{}", nothing.help);
}

#[test]
fn another_servo_brings_its_limits_and_where_parts_are_that_servo_its_mass() {
    let catalog = Catalog::shipped();
    let mass = |robot: &Robot| -> f64 { robot.links.iter().map(|link| link.mass_kg).sum() };
    let before = read(&agilebot());
    for (actuator, name, parts, was_kg) in
        [("xm540", "MX-64AT", 8.0, 0.165), ("xm430_drive", "XL430-W250-T", 4.0, 0.082)]
    {
        let servo = catalog.get(name).unwrap();
        let mut text = agilebot();
        text.set_servo(actuator, servo);
        let after = read(&text);
        let heavier = mass(&after) - mass(&before);
        assert!((heavier - parts * (servo.mass_kg - was_kg)).abs() < 1e-9, "{name}: {heavier}");
        assert_eq!(text.model_of(actuator), Some(name));
        let motors = after.joints.iter().map(|joint| &joint.actuator);
        let wheels = after.end_effectors.iter().filter_map(|of| of.contact.actuator());
        let motor = motors.chain(wheels).find(|motor| motor.model == name).unwrap();
        // A wheel may use more of the no-load speed.
        let speed_max_rad_s = match actuator {
            "xm540" => servo.speed_max_rad_s,
            _ => servo.wheel_speed_max_rad_s(),
        };
        assert_eq!(motor.speed_max_rad_s, speed_max_rad_s);
        assert!(text.to_string().contains("# hip pitch servo XM540: e-manual"), "comments stay");
    }
    // Nothing determines the part.
    let mut text = RobotText::new(&AGILEBOT.replace(", actuator = \"xm540\" }", " }")).unwrap();
    text.set_servo("xm540", catalog.get("MX-64AT").unwrap());
    assert!(text.parts_of("xm540").is_empty());
    assert_eq!(mass(&read(&text)), mass(&before));
}
