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
