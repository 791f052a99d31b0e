//! Tests of springs and dampers at joints: their torque, and faults of their values.

use super::*;
use rollwalk_robot::JointSpring;
use rollwalk_robot::document::Fault;

/// Robot with a spring at the joint of each leg.
fn sprung(spring: &str) -> String {
    let leg = "nominal_rad = 0.1\nactuator = \"servo\"\n";
    ROBOT.replacen(leg, &format!("{leg}spring = {spring}\n"), 1)
}

#[test]
fn a_spring_in_a_template_is_that_of_every_limb() {
    let text = sprung("{ stiffness_nm_rad = 4.0, rest_rad = -0.6, damping_nm_s_rad = 0.05 }");
    let robot = Robot::from_toml("tiny.toml", &text).unwrap();
    let spring = JointSpring { stiffness_nm_rad: 4.0, rest_rad: -0.6, damping_nm_s_rad: 0.05 };
    let found: Vec<_> = robot.joints.iter().map(|joint| joint.spring).collect();
    assert_eq!(found, [None, Some(spring), Some(spring)]);
    // 4 N·m/rad times 1 rad towards the rest angle, and 0.05 N·m·s/rad against 2 rad/s.
    let spring = robot.joints[1].spring.expect("a spring");
    assert!((spring.torque_nm(0.4, 2.0) + 4.1).abs() < 1e-12);
    assert_eq!(robot.joints[0].spring, None);
}

#[test]
fn a_damper_needs_no_rest_angle() {
    let robot = Robot::from_toml("tiny.toml", &sprung("{ damping_nm_s_rad = 0.05 }")).unwrap();
    let damper = JointSpring { damping_nm_s_rad: 0.05, ..JointSpring::default() };
    assert_eq!(robot.joints[1].spring, Some(damper));
}

#[test]
fn faults_of_springs_have_the_right_value() {
    let faults_of = |spring: &str| {
        let error = Robot::from_toml("tiny.toml", &sprung(spring)).unwrap_err();
        let shown = |of: &Fault| format!("{} ({})", of.message, of.help);
        error.faults().map(shown).collect::<Vec<_>>()
    };
    for (spring, expected) in [
        (
            "{ rest_rad = 0.1 }",
            "`stiffness_nm_rad` is missing (give `stiffness_nm_rad`, `damping_nm_s_rad` or both, or leave `spring` out)",
        ),
        (
            "{ stiffness_nm_rad = 3.0 }",
            "`rest_rad` is missing (give the angle of the joint at which the spring has no torque, in rad)",
        ),
        (
            "{ stiffness_nm_rad = -3.0, rest_rad = 0.0 }",
            "`stiffness_nm_rad` is -3 N·m/rad (give a value from 0 to 655 N·m/rad)",
        ),
        (
            "{ stiffness_nm_rad = 3.0, rest_rad = -35.0 }",
            "`rest_rad` is -35 rad (give an angle within ±20 rad; -35 degrees would be -0.6109 rad)",
        ),
        (
            "{ damping_nm_s_rad = 100.0 }",
            "`damping_nm_s_rad` is 100 N·m·s/rad (give a value from 0 to 65 N·m·s/rad)",
        ),
        ("{ stiffness_nm = 3.0, damping_nm_s_rad = 0.1 }", "unknown key `stiffness_nm`"),
    ] {
        let faults = faults_of(spring);
        assert!(faults[0].contains(expected), "{spring}: {faults:?}");
    }
}

/// Robot whose legs have a spring and no motor.
fn passive(spring: &str) -> String {
    let leg = "nominal_rad = 0.1\nactuator = \"servo\"\n";
    ROBOT.replacen(leg, &format!("nominal_rad = 0.1\nspring = {spring}\n"), 1)
}

#[test]
fn a_joint_with_a_spring_alone_has_no_channel_and_takes_no_address() {
    let text = passive("{ stiffness_nm_rad = 4.0, rest_rad = 0.2 }");
    let robot = Robot::from_toml("tiny.toml", &text).unwrap();
    let is_passive: Vec<_> = robot.joints.iter().map(|joint| joint.is_passive()).collect();
    assert_eq!(is_passive, [false, true, true]);
    let channels: Vec<_> = robot.channels().map(|channel| channel.name().to_owned()).collect();
    assert_eq!(channels, ["shoulder", "wheel"]);
    assert_eq!(robot.controller_config().unwrap().channels.len(), 2);
    assert_eq!(robot.of_driven_joints(&[1, 2, 3]).collect::<Vec<_>>(), [1]);
    let all = robot.all_joints([0.5], |index, joint| joint.nominal_rad + index as f64);
    assert_eq!(all, [0.5, 1.1, 2.1]);
    // A plan file keeps such a joint, without a motor.
    let json = serde_json::to_value(&robot).unwrap();
    assert!(json["joints"][0].get("actuator").is_some());
    assert!(json["joints"][1].get("actuator").is_none());
    assert_eq!(serde_json::from_value::<Robot>(json).unwrap(), robot);
}

#[test]
fn faults_of_passive_joints_name_the_spring_or_the_motor() {
    let spring = "spring = { stiffness_nm_rad = 4.0, rest_rad = 0.2 }";
    let motor = "nominal_rad = 0.1\nactuator = \"servo\"\n";
    let faulty = |to: &str, at: &str, message: &str, help: &str| {
        assert_fault(motor, &format!("nominal_rad = 0.1\n{to}\n"), at, message, help);
    };
    faulty(
        "spring = { damping_nm_s_rad = 0.1 }",
        "spring",
        "joint `left_hip`: `spring` does not hold the joint, which has no `actuator`",
        "`stiffness_nm_rad` above 0",
    );
    faulty(
        &format!("motor_per_joint = {{ \"*_hip\" = 2.0 }}\n{spring}"),
        "motor_per_joint",
        "`motor_per_joint` has no motor",
        "leave out `motor_per_joint`",
    );
    faulty(
        &format!("{spring}\nid = 3"),
        "id = 3",
        "`id` belongs to a motor",
        "leave out `bus` and `id`",
    );
    faulty(
        "spring = { stiffness_nm_rad = 4000.0, rest_rad = 0.2 }",
        "spring",
        "`stiffness_nm_rad` is 4000 N·m/rad",
        "from 0 to 655",
    );
    let text = passive("{ stiffness_nm_rad = 4.0, rest_rad = 0.2 }");
    let couples =
        text.replacen("id = 1\n", "id = 1\nmotor_per_joint = { shoulder = 1, left_hip = 1 }\n", 1);
    let error = Robot::from_toml("tiny.toml", &couples).unwrap_err();
    let found = error.faults().next().unwrap().message.clone();
    assert!(
        found.contains("`motor_per_joint` names `left_hip`, a joint without a motor"),
        "{found}"
    );
}
