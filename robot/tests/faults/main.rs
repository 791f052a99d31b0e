//! Tests of error messages for robot files: each class of fault has line, field, value and the correct value.

mod contacts;
mod couplings;
mod document;
mod linkages;
mod prismatic;
mod rules;
mod shapes;
mod springs;
mod upright;

use rollwalk_robot::Robot;

/// Small robot for the faults: a body, an arm with an actuated wheel, and a limb with a foot.
const ROBOT: &str = r#"name = "tiny"

[actuator.servo]
model = "S1"
speed_max_rad_s = 5.0
torque_max_nm = 2.0
kp_nm_rad = 50.0
kd_nm_s_rad = 1.0
armature_kg_m2 = 0.005

[[link]]
name = "body"
mass_kg = 1.0
com_in_link_m = [0.0, 0.0, 0.0]
inertia_in_link_kg_m2 = [0.01, 0.02, 0.02, 0.0, 0.0, 0.0]

[[link]]
name = "arm"
parts = [
  { mass_kg = 0.1, at_m = [0.0, 0.0, -0.1], box_m = [0.02, 0.02, 0.2] },
  { mass_kg = 0.1, at_m = [0.0, 0.0, -0.2], cylinder_y_m = [0.03, 0.02] },
]

[[joint]]
name = "shoulder"
parent = "body"
child = "arm"
origin_in_parent_m = [0.1, 0.0, 0.0]
origin_rpy_rad = [0.0, 0.1, 0.0]
axis_in_joint = [0.0, 2.0, 0.0]
position_min_rad = -1.0
position_max_rad = 1.0
nominal_rad = 0.0
actuator = "servo"
bus = 0
id = 1

[[end_effector]]
name = "wheel"
link = "arm"
center_in_link_m = [0.0, 0.0, -0.2]
radius_m = 0.03
friction_coefficient = 0.8
contact = "actuated_wheel"
axis_in_link = [0.0, 1.0, 0.0]
actuator = "servo"
bus = 0
id = 2

[[template.leg.link]]
name = "*_shank"
parts = [{ mass_kg = 0.1, at_m = [0.0, 0.01, -0.1], box_m = [0.02, 0.02, 0.2] }]

[[template.leg.joint]]
name = "*_hip"
parent = "mount"
child = "*_shank"
origin_in_parent_m = [0.0, 0.02, 0.0]
axis_in_joint = [1.0, 0.0, 0.0]
position_min_rad = -0.5
position_max_rad = 0.5
nominal_rad = 0.1
actuator = "servo"

[[template.leg.end_effector]]
name = "*"
link = "*_shank"
center_in_link_m = [0.0, 0.01, -0.2]
radius_m = 0.01
friction_coefficient = 0.8
contact = "point_foot"

[[limb]]
name = "left"
template = "leg"
parent = "body"
origin_in_parent_m = [-0.1, 0.1, 0.0]
side = "left"
bus = 1
first_id = 1

[[limb]]
name = "right"
template = "leg"
parent = "body"
origin_in_parent_m = [-0.1, -0.1, 0.0]
side = "right"
bus = 1
first_id = 2
"#;

fn tiny() -> Robot {
    Robot::from_toml("tiny.toml", ROBOT).unwrap()
}

/// Line, message and help of each fault after `from` is replaced by `to`.
fn faults(from: &str, to: &str) -> Vec<(usize, String, String)> {
    assert!(ROBOT.contains(from), "the robot to break has changed: {from}");
    let text = ROBOT.replacen(from, to, 1);
    let error = Robot::from_toml("tiny.toml", &text).expect_err("the robot is broken");
    error.faults().map(|fault| (fault.line, fault.message.clone(), fault.help.clone())).collect()
}

/// Asserts exactly one fault after `from` is replaced by `to`, at the line that starts with `at`, with the given message and
/// help.
#[track_caller]
fn assert_fault(from: &str, to: &str, at: &str, message: &str, help: &str) {
    let text = ROBOT.replacen(from, to, 1);
    let line = 1 + text.lines().position(|line| line.starts_with(at)).expect("line is there");
    let found = faults(from, to);
    assert_eq!(found.len(), 1, "{found:#?}");
    assert_eq!(found[0].0, line, "{found:#?}");
    assert!(found[0].1.contains(message), "{:?} lacks {message:?}", found[0].1);
    assert!(found[0].2.contains(help), "{:?} lacks {help:?}", found[0].2);
}

#[test]
fn the_tiny_robot_is_valid_and_its_right_limb_is_mirrored() {
    let robot = tiny();
    let names: Vec<_> = robot.joints.iter().map(|joint| joint.name.as_str()).collect();
    assert_eq!(names, ["shoulder", "left_hip", "right_hip"]);
    // Axes of any length become unit vectors.
    assert_eq!(robot.joints[0].axis_in_joint.y, 1.0);
    let (left, right) = (&robot.joints[1], &robot.joints[2]);
    assert_eq!(left.parent_from_joint.translation.y, 0.1 + 0.02);
    assert_eq!(right.parent_from_joint.translation.y, -0.1 - 0.02);
    // Rolling the left leg outward is a turn about +x, the right leg's about −x.
    assert_eq!((left.axis_in_joint.x, right.axis_in_joint.x), (1.0, -1.0));
    assert_eq!(robot.end_effectors[2].center_in_link_m.y, -0.01);
    assert_eq!((right.actuator.bus, right.actuator.id), (1, 2));
}

#[test]
fn a_report_shows_file_line_field_value_and_help() {
    let text = ROBOT.replacen("position_max_rad = 1.0", "position_max_rad = 90.0", 1);
    let text = text.replacen("mass_kg = 1.0", "mass_kg = -1.0", 1);
    let error = Robot::from_toml("robots/tiny.toml", &text).unwrap_err();
    assert_eq!(
        error.to_string(),
        "robots/tiny.toml:13: link `body`: `mass_kg` is -1 kg (and 1 more error)"
    );
    let theme = miette::GraphicalTheme::unicode_nocolor();
    let handler = miette::GraphicalReportHandler::new_themed(theme).with_width(100);
    let mut report = String::new();
    handler.render_report(&mut report, &error).unwrap();
    for shown in [
        "[robots/tiny.toml:13:11]",
        "mass_kg = -1.0",
        "give a value above 0 to 1000 kg",
        "[robots/tiny.toml:32:20]",
        "position_max_rad = 90.0",
        "joint `shoulder`: `position_max_rad` is 90 rad",
        "give an angle within ±2π rad; 90 degrees would be 1.5708 rad",
    ] {
        assert!(report.contains(shown), "lacks {shown:?}:\n{report}");
    }
}
