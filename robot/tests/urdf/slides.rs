//! Tests of prismatic joints: legs that slide, joints that slide elsewhere, and their units.

use super::faults::refused;
use super::made::{CORNERS, Made, WIDE, ball, imported};
use super::{SIDE, URDF, good};
use rollwalk_robot::Robot;
use rollwalk_robot::urdf::{Text, survey};

const STROKE: &str = "lower=\"-0.02\" upper=\"0.1\" effort=\"150\" velocity=\"0.4\"";

/// Trunk on four legs of a hip and a shin that slides down.
fn telescopic(limit: &str) -> String {
    let mut made = Made::trunk();
    for (name, x, y) in CORNERS {
        let [guide, shin, foot] = ["guide", "shin", "foot"].map(|part| format!("{name}_{part}"));
        made.link(&guide, 0.5, [0.0, 0.0, -0.1], 2e-3, "");
        made.link(&shin, 0.3, [0.0, 0.0, -0.05], 1e-3, "");
        made.link(&foot, 0.05, [0.0; 3], 1e-5, &ball(0.02, [0.0; 3]));
        let joints = ["hip", "slide", "end"].map(|part| format!("{name}_{part}"));
        let [hip, slide, end] = joints.each_ref().map(String::as_str);
        made.joint("revolute", [hip, "trunk", &guide], [x, y, 0.0], [0.0, 1.0, 0.0], WIDE);
        made.joint("prismatic", [slide, &guide, &shin], [0.0, 0.0, -0.15], [0.0, 0.0, -1.0], limit);
        made.joint("fixed", [end, &shin, &foot], [0.0, 0.0, -0.12], [0.0, 1.0, 0.0], "");
    }
    made.urdf()
}

#[test]
fn legs_that_slide_keep_their_stroke_force_and_speed() {
    let (found, robot) = imported(&telescopic(STROKE));
    assert_eq!(found.end_effectors.len(), 4);
    assert!(found.template.contains("LF_slide = { nominal_m = 0.04 }"), "{}", found.template);
    let slides: Vec<_> = robot.joints.iter().filter(|joint| joint.is_prismatic()).collect();
    assert_eq!(slides.len(), 4);
    for joint in slides {
        let travel = joint.travel_m_per_rad.unwrap();
        assert_eq!(travel, 0.02);
        let near = |angle_rad: f64, position_m: f64| {
            assert!((angle_rad * travel - position_m).abs() < 1e-9, "{angle_rad} {position_m}")
        };
        near(joint.position_min_rad, -0.02);
        near(joint.position_max_rad, 0.1);
        near(joint.nominal_rad, 0.04);
        assert!((joint.actuator.torque_max_nm / travel - 150.0).abs() < 1e-9);
        assert!((joint.actuator.speed_max_rad_s * travel - 0.4).abs() < 1e-9);
        // A quarter of the weight yields by 1 % of the leg, unless this stiffness would be unstable or saturate.
        let stiffness_n_m = joint.actuator.kp_nm_rad / (travel * travel);
        assert!((1e3..1e5).contains(&stiffness_n_m), "{stiffness_n_m}");
    }
    let long = telescopic("lower=\"0\" upper=\"0.3\" effort=\"150\" velocity=\"0.4\"");
    let (_, robot) = imported(&long);
    let travel = robot.joints[1].travel_m_per_rad.unwrap();
    assert!((travel - 0.05).abs() < 1e-12, "0.3 m within 6 rad: {travel}");
}

#[test]
fn slides_without_a_stroke_or_a_foot_are_locked() {
    let found = survey(Text { name: "made", text: &telescopic("effort=\"9\"") }).unwrap();
    let slide = found.joints.iter().find(|joint| joint.name == "LF_slide").unwrap();
    assert_eq!(slide.proposal, "locked at 0");
    let found = survey(Text { name: "rover.urdf", text: URDF }).unwrap();
    let warning = found.warnings.iter().find(|warning| warning.contains("joint `mast`"));
    let warning = warning.unwrap_or_else(|| panic!("{:?}", found.warnings));
    assert!(warning.contains("slides and carries no foot or wheel"), "{warning}");
}

/// The mast of the rover, unlocked.
fn mast(joint: &str) -> String {
    SIDE.replacen("mast = 0.15", "", 1).replacen("[joint]\n", &format!("[joint]\n{joint}\n"), 1)
}

#[test]
fn a_side_file_unlocks_a_slide_in_metres() {
    let robot: Robot = good(
        URDF,
        &mast("mast = { nominal_m = 0.1, position_max_m = 0.2, travel_m_per_rad = 0.05 }"),
    )
    .robot;
    let joint = robot.joints.iter().find(|joint| joint.name == "mast").unwrap();
    assert_eq!(joint.travel_m_per_rad, Some(0.05));
    let range = [joint.position_min_rad, joint.position_max_rad, joint.nominal_rad];
    for (angle_rad, expected) in range.into_iter().zip([0.0, 4.0, 2.0]) {
        assert!((angle_rad - expected).abs() < 1e-9, "{range:?}");
    }
    let unlocked = good(URDF, &mast(""));
    assert!(
        unlocked.warnings.iter().any(|warning| warning.contains("give `travel_m_per_rad`")),
        "{:?}",
        unlocked.warnings
    );
    refused(URDF, &mast("mast = { nominal_rad = 0.1 }"), &["`mast` slides", "`nominal_m`"]);
    let hip = SIDE.replacen("left_hip = { nominal_rad", "left_hip = { nominal_m", 1);
    assert_ne!(hip, SIDE);
    refused(URDF, &hip, &["`left_hip` turns", "`nominal_rad`"]);
}

/// A slide of MJCF with a spring, and the force range of its motor with a gear.
#[test]
fn slides_of_mjcf_have_the_forces_of_their_gears_and_springs_in_metres() {
    let leg = |name: &str, x: f64, y: f64| {
        format!(
            "<body name=\"{name}\" pos=\"{x} {y} -0.1\"><joint name=\"{name}_slide\" type=\"slide\" axis=\"0 0 -1\" range=\"0 0.1\" \
             stiffness=\"300\" springref=\"0.12\" damping=\"4\"/><geom type=\"sphere\" size=\"0.02\" pos=\"0 0 -0.1\" mass=\"0.2\"/></body>"
        )
    };
    let legs: String = CORNERS.iter().map(|(name, x, y)| leg(name, *x, *y)).collect();
    let motors: String = CORNERS
        .iter()
        .map(|(name, ..)| {
            format!("<position name=\"{name}\" joint=\"{name}_slide\" kp=\"20\" kv=\"1\" gear=\"50\" forcerange=\"-2 2\"/>")
        })
        .collect();
    let text = format!(
        "<mujoco model=\"m\"><worldbody><body name=\"trunk\"><freejoint/><geom type=\"box\" size=\"0.3 0.2 0.05\" mass=\"4\"/>{legs}</body>\
         </worldbody><actuator>{motors}</actuator></mujoco>"
    );
    let (_, robot) = imported(&text);
    let joint = robot.joints.iter().find(|joint| joint.name == "LF_slide").unwrap();
    let travel = joint.travel_m_per_rad.unwrap();
    assert!((joint.actuator.torque_max_nm / travel - 100.0).abs() < 1e-9);
    let spring = joint.spring.unwrap();
    let square = travel * travel;
    assert!((spring.stiffness_nm_rad / square - 300.0).abs() < 1e-6);
    assert!((spring.rest_rad * travel - 0.12).abs() < 1e-9);
    assert!((spring.damping_nm_s_rad / square - 4.0).abs() < 1e-6);
}
