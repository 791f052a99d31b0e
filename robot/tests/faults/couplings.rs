//! Tests of coupled servos: their map, their range, and faults of their ratios.

use super::*;
use rollwalk_robot::{Joint, Transmission};

/// Two joints in a row, with ratios of the second one's servo.
fn two(coupling: &str) -> String {
    let elbow = r#"[[joint]]
name = "elbow"
parent = "arm"
child = "hand"
origin_in_parent_m = [0.0, 0.0, -0.2]
axis_in_joint = [0.0, 1.0, 0.0]
position_min_rad = -2.0
position_max_rad = -0.5
nominal_rad = -0.9
actuator = "servo"
bus = 0
id = 3
motor_per_joint = COUPLING

[[link]]
name = "hand"
mass_kg = 0.1
com_in_link_m = [0.0, 0.0, 0.0]
inertia_in_link_kg_m2 = [0.001, 0.001, 0.001, 0.0, 0.0, 0.0]

[[end_effector]]"#;
    ROBOT.replacen("[[end_effector]]", &elbow.replace("COUPLING", coupling), 1)
}

#[test]
fn a_belt_turns_its_servo_with_both_joints() {
    let text = two("{ shoulder = 1.5, elbow = 1.5 }");
    let robot = Robot::from_toml("belt.toml", &text).unwrap();
    let [shoulder, elbow] = ["shoulder", "elbow"]
        .map(|name| robot.joints.iter().position(|joint| joint.name == name).unwrap());
    let belt = robot.transmission();
    let mut joints = vec![0.0; robot.joints.len()];
    (joints[shoulder], joints[elbow]) = (0.3, -0.7);
    let motors = belt.motors(&joints);
    assert!((motors[shoulder] - 0.3).abs() < 1e-15 && (motors[elbow] + 0.6).abs() < 1e-15);
    for (joint, back) in joints.iter().zip(belt.joints(&motors)) {
        assert!((joint - back).abs() < 1e-15, "rounding only");
    }
    // Equal power: the belt's torque acts on both joints.
    let mut motors_nm = vec![0.0; robot.joints.len()];
    (motors_nm[shoulder], motors_nm[elbow]) = (0.2, 1.0);
    let joints_nm = belt.nominal().joint_torques(&motors_nm);
    assert!((joints_nm[shoulder] - 1.7).abs() < 1e-15 && (joints_nm[elbow] - 1.5).abs() < 1e-15);
    for (motor, back) in motors_nm.iter().zip(belt.nominal().motor_torques(&joints_nm)) {
        assert!((motor - back).abs() < 1e-15, "rounding only");
    }
    // 1.5 times the sum of [-1, 1] and [-2, -0.5].
    let config = robot.controller_config().unwrap();
    assert_eq!((config.channels[elbow].min, config.channels[elbow].max), (-4.5, 0.75));
    assert_eq!((config.channels[shoulder].min, config.channels[shoulder].max), (-1.0, 1.0));
    let fastest_rad_s = belt.nominal().joint_speed_max_rad_s(&robot, elbow);
    assert!((fastest_rad_s - (5.0 / 1.5 + 5.0)).abs() < 1e-12, "{fastest_rad_s}");
}

#[test]
fn ratios_that_no_transmission_has() {
    for (coupling, problem, help) in [
        ("{ sholder = 1.0, elbow = 1.0 }", "there is no joint `sholder`", "shoulder"),
        ("{ shoulder = 0.0, elbow = 1.0 }", "`motor_per_joint` of `shoulder` is 0", "leave out"),
        ("{ elbow = 300.0 }", "`motor_per_joint` of `elbow` is 300", "of magnitude 0.01 to 100"),
        ("{ shoulder = 1.0 }", "`motor_per_joint` lacks the joint itself", "add `elbow = 1.0`"),
        ("{}", "`motor_per_joint` is empty", "leave the table out"),
        ("1.5", "`motor_per_joint` must be a table", "give a table"),
    ] {
        let error = format!("{:?}", Robot::from_toml("belt.toml", &two(coupling)).unwrap_err());
        assert!(error.contains(problem) && error.contains(help), "{coupling}\n{error}");
    }
}

#[test]
fn a_servo_that_would_turn_further_than_its_bus_commands_is_refused() {
    let text = two("{ shoulder = 12.0, elbow = 12.0 }");
    let error = Robot::from_toml("belt.toml", &text).unwrap_err();
    let fault = error.faults().next().unwrap();
    assert!(fault.message.contains("range of -36.000 to 6.000 rad"), "{}", fault.message);
    assert!(fault.help.contains("narrow the limits"), "{}", fault.help);
}

#[test]
fn servos_that_leave_joints_free_are_refused() {
    let text = two("{ shoulder = 1.0, elbow = 1.0 }").replacen(
        "id = 1\n",
        "id = 1\nmotor_per_joint = { shoulder = 1.0, elbow = 1.0 }\n",
        1,
    );
    let error = Robot::from_toml("belt.toml", &text).unwrap_err().to_string();
    assert!(error.contains("lets joints move while no motor turns"), "{error}");
    let mut robot = Robot::from_toml("belt.toml", &two("{ shoulder = 1.0, elbow = 1.0 }")).unwrap();
    let elbow = robot.joints.iter().position(Joint::is_coupled).unwrap();
    let shoulder = robot.joints.iter().position(|joint| joint.name == "shoulder").unwrap();
    robot.joints[shoulder].motor_per_joint = robot.joints[elbow].motor_per_joint.clone();
    assert_eq!(Transmission::new(&robot), None);
}
