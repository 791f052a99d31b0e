//! Tests of prismatic joints and linear actuators: units, mirrored legs, and faults of their values.

use super::*;
use rollwalk_robot::JointSpring;

const HIP: &str = "axis_in_joint = [1.0, 0.0, 0.0]\nposition_min_rad = -0.5\nposition_max_rad = 0.5\nnominal_rad = 0.1\nactuator = \"servo\"\n";

/// Keys of a leg that slides, with a change.
fn slide(from: &str, to: &str) -> String {
    let keys = "kind = \"prismatic\"\naxis_in_joint = [0.0, 3.0, -4.0]\ntravel_m_per_rad = 0.02\n\
        position_min_m = -0.01\nposition_max_m = 0.05\nnominal_m = 0.02\nactuator = \"servo\"\n";
    assert!(keys.contains(from), "{from}");
    keys.replacen(from, to, 1)
}

fn robot(from: &str, to: &str) -> Robot {
    let text = ROBOT.replacen(HIP, &slide(from, to), 1);
    Robot::from_toml("tiny.toml", &text).unwrap_or_else(|error| panic!("{error}"))
}

#[test]
fn positions_become_angles_of_the_pinion_and_axes_are_mirrored_as_directions() {
    let robot = robot("", "");
    let [arm, left, right] = &robot.joints[..] else { panic!("three joints") };
    assert_eq!([arm.travel_m_per_rad, left.travel_m_per_rad], [None, Some(0.02)]);
    let range = [left.position_min_rad, left.position_max_rad, left.nominal_rad];
    assert_eq!(range, [-0.01, 0.05, 0.02].map(|position: f64| position / 0.02));
    assert_eq!(left.axis_in_joint.as_slice(), [0.0, 0.6, -0.8]);
    assert_eq!(right.axis_in_joint.as_slice(), [0.0, -0.6, -0.8]);
    let moved = left.joint_from_child(left.nominal_rad);
    assert!((moved.translation.vector - left.axis_in_joint * 0.02).norm() < 1e-15);
    assert_eq!(moved.rotation.angle(), 0.0);
    // The motor is that of the data sheet.
    assert_eq!(left.actuator.torque_max_nm, 2.0);
    let json = serde_json::to_value(&robot).unwrap();
    assert!(json["joints"][0].get("travel_m_per_rad").is_none(), "as in files of other robots");
    assert_eq!(json["joints"][1]["travel_m_per_rad"], 0.02);
    assert_eq!(serde_json::from_value::<Robot>(json).unwrap(), robot);
}

/// A robot with linear actuators and springs of its legs.
fn linear(joint: &str) -> String {
    let sheet = "[actuator.cylinder]\nmodel = \"C1\"\nspeed_max_m_s = 0.3\nforce_max_n = 90.0\n\
        stall_force_n = 150.0\nno_load_speed_m_s = 0.4\nkp_n_m = 2e4\nkd_n_s_m = 200.0\narmature_kg = 2.5\n\n[[link]]";
    let text = ROBOT.replacen("[[link]]", sheet, 1);
    text.replacen(HIP, &slide("actuator = \"servo\"", joint), 1)
}

#[test]
fn a_linear_actuator_is_its_motor_at_the_pinion() {
    let text = linear(
        "actuator = \"cylinder\"\nspring = { stiffness_n_m = 500.0, rest_m = 0.06, damping_n_s_m = 3.0 }",
    );
    let robot = Robot::from_toml("tiny.toml", &text).unwrap_or_else(|error| panic!("{error}"));
    let joint = &robot.joints[1];
    let motor = &joint.actuator;
    let line = motor.torque_speed.unwrap();
    for (found, expected) in [
        (motor.speed_max_rad_s, 0.3 / 0.02),
        (motor.torque_max_nm, 90.0 * 0.02),
        (line.stall_torque_nm, 150.0 * 0.02),
        (line.no_load_speed_rad_s, 0.4 / 0.02),
        (motor.kp_nm_rad, 2e4 * 0.02 * 0.02),
        (motor.kd_nm_s_rad, 200.0 * 0.02 * 0.02),
        (motor.armature_kg_m2, 2.5 * 0.02 * 0.02),
    ] {
        assert!((found - expected).abs() < 1e-12, "{found} {expected}");
    }
    let JointSpring { stiffness_nm_rad, rest_rad, damping_nm_s_rad } = joint.spring.unwrap();
    assert!((stiffness_nm_rad - 0.2).abs() < 1e-12 && (rest_rad - 3.0).abs() < 1e-12);
    assert!((damping_nm_s_rad - 3.0 * 0.02 * 0.02).abs() < 1e-12);
    // 90 N at the joint are 1.8 N·m at the motor, on the wire as well.
    let config = robot.controller_config().unwrap();
    assert_eq!(config.channels[1].max_torque_nm, 1.8);
    assert_eq!([config.channels[1].min, config.channels[1].max], [-0.5, 2.5]);
}

#[test]
fn a_joint_on_a_spring_alone_slides() {
    let text = linear("spring = { stiffness_n_m = 500.0, rest_m = 0.03 }");
    let robot = Robot::from_toml("tiny.toml", &text).unwrap_or_else(|error| panic!("{error}"));
    assert!(robot.joints[1].is_passive() && robot.joints[1].is_prismatic());
    assert_eq!(robot.channels().count(), 2);
}

#[test]
fn faults_of_prismatic_joints_have_the_right_value() {
    let faulty = |from: &str, to: &str, at: &str, message: &str, help: &str| {
        assert_fault(HIP, &slide(from, to), at, message, help);
    };
    let travel = "travel_m_per_rad = 0.02";
    faulty(travel, "", "[[template.leg.joint]]", "`travel_m_per_rad` is missing", "");
    faulty(
        travel,
        "travel_m_per_rad = 20",
        "travel_m_per_rad",
        "`travel_m_per_rad` is 20",
        "the radius of a pinion, or the lead of a screw divided by 2π",
    );
    faulty(
        travel,
        "travel_m_per_rad = 0.005",
        "position_max_m",
        "`position_max_m` is 0.05 m, 10 rad of the motor",
        "give a position within ±0.0314 m, or a `travel_m_per_rad` of at least 0.00796 m/rad",
    );
    faulty(
        "position_min_m = -0.01",
        "position_min_m = 0.05",
        "position_max_m",
        "`position_max_m` is 0.05 m",
        "give a value above `position_min_m` (0.05 m)",
    );
    faulty(
        "nominal_m = 0.02",
        "nominal_m = 0.06",
        "nominal_m",
        "`nominal_m` is 0.06 m",
        "give a position within the limits, -0.01 to 0.05 m",
    );
    faulty(
        "position_min_m = -0.01",
        "position_min_rad = -0.01",
        "position_min_rad = -0.01",
        "unknown key `position_min_rad`, and `position_min_m` is missing",
        "did you mean `position_min_m`?",
    );
    faulty("\"prismatic\"", "\"sliding\"", "kind", "`kind` cannot be \"sliding\"", "`prismatic`");
    faulty(
        "kind = \"prismatic\"\n",
        "",
        "[[template.leg.joint]]",
        "`kind` is missing",
        "give `kind = \"prismatic\"` if the joint slides",
    );
    faulty(
        "actuator = \"servo\"",
        "motor_per_joint = { \"*_hip\" = 1.0 }\nactuator = \"servo\"",
        "motor_per_joint",
        "`motor_per_joint` names `left_hip`, a prismatic joint",
        "leave out `motor_per_joint`",
    );
}

#[test]
fn faults_of_linear_actuators_name_their_keys() {
    let fault = |text: &str| {
        let error = Robot::from_toml("tiny.toml", text).unwrap_err();
        let fault = error.faults().next().unwrap();
        (fault.line, fault.message.clone(), fault.help.clone())
    };
    let line = |text: &str, at: &str| 1 + text.lines().position(|of| of.starts_with(at)).unwrap();
    let strong =
        linear("actuator = \"cylinder\"").replace("force_max_n = 90.0", "force_max_n = 0.0");
    let (at, message, help) = fault(&strong);
    assert_eq!(at, line(&strong, "force_max_n"));
    assert!(message.contains("`torque_max_nm` is 0 N·m"), "{message}");
    assert!(
        help.contains("slides 0.02 m per radian of its motor") && help.contains("1 N·m is 50 N"),
        "{help}"
    );
    let turns = linear("actuator = \"cylinder\"").replacen(
        "actuator = \"servo\"\nbus = 0\nid = 1",
        "actuator = \"cylinder\"\nbus = 0\nid = 1",
        1,
    );
    let (_, message, help) = fault(&turns);
    assert!(
        message.contains("joint `shoulder`: `actuator` is \"cylinder\", a linear actuator"),
        "{message}"
    );
    assert!(help.contains("kind = \"prismatic\""), "{help}");
}
