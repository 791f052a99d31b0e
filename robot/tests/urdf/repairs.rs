//! Tests of repairs: the import corrects gaps and small errors of a URDF as documented, and warns.

use super::{SIDE, URDF, edited, good};
use rollwalk_robot::{Joint, Robot};

#[track_caller]
fn warns(urdf: &str, side: &str, words: &[&str]) -> Robot {
    let imported = good(urdf, side);
    let warned =
        imported.warnings.iter().any(|warning| words.iter().all(|word| warning.contains(word)));
    assert!(warned, "{words:?} is missing in\n{}", imported.warnings.join("\n"));
    imported.robot
}

fn joint<'r>(robot: &'r Robot, name: &str) -> &'r Joint {
    robot.joints.iter().find(|joint| joint.name == name).unwrap()
}

#[test]
fn a_sound_urdf_has_nothing_to_warn_of() {
    assert_eq!(good(URDF, SIDE).warnings, [""; 0]);
}

#[test]
fn inertias_become_physical() {
    let thin = edited(
        URDF,
        "ixx=\"0.0008\" ixy=\"0\" ixz=\"0\" iyy=\"0.0008\" iyz=\"0\" izz=\"0.0001\"/>
    </inertial>
  </link>
  <joint name=\"left_ankle\"",
        "ixx=\"0.0008\" ixy=\"0\" ixz=\"0\" iyy=\"0.0001\" iyz=\"0\" izz=\"0.0001\"/>
    </inertial>
  </link>
  <joint name=\"left_ankle\"",
    );
    // The foot is fixed to the shank and adds enough to make it physical, so no warning follows.
    good(&thin, SIDE);
    let arm = "<mass value=\"0.3\"/>\n      <inertia ixx=\"0.001\" ixy=\"0\" ixz=\"0\" iyy=\"0.001\" iyz=\"0\" izz=\"0.001\"/>";
    // The wheel is on the arm. Without the wheel, the arm's own inertia counts.
    let alone = edited(
        SIDE,
        "wheel_joint = \"left_axle\"",
        "link = \"left_arm_link\"\naxis_in_link = [0, 1, 0]",
    );
    for (inertia, words, moments) in [
        (
            "ixx=\"0.001\" iyy=\"0.001\" izz=\"0.005\"",
            "break the triangle inequality",
            [2.0013e-3, 2.0013e-3, 3.9987e-3],
        ),
        ("ixx=\"0\" iyy=\"0\" izz=\"0\"", "not all above 0", [3e-7, 3e-7, 3e-7]),
        // −0.0004 becomes 3e-7. The excess 0.0005997 is shared, with a margin of 0.1 %.
        (
            "ixx=\"-0.0004\" iyy=\"0.0004\" izz=\"0.001\"",
            "not all above 0",
            [2.0047e-4, 6.0017e-4, 7.9983e-4],
        ),
    ] {
        let urdf = edited(URDF, arm, &format!("<mass value=\"0.3\"/><inertia {inertia}/>"));
        let robot = warns(&urdf, &alone, &["rover.urdf:", "`left_arm_link`", words]);
        let link = robot.links.iter().find(|link| link.name == "left_arm_link").unwrap();
        for (axis, expected) in moments.into_iter().enumerate() {
            let moment = link.inertia_in_link_kg_m2[(axis, axis)];
            // Moments are given with five digits above.
            assert!((moment - expected).abs() < 1e-7, "{inertia}: {moment} {expected}");
        }
    }
    let without = edited(URDF, arm, "<mass value=\"0.3\"/>");
    warns(&without, &alone, &["`left_arm_link`", "not all above 0"]);
}

#[test]
fn links_without_mass_are_told() {
    let arm = "<mass value=\"0.3\"/>";
    let alone = edited(
        SIDE,
        "wheel_joint = \"left_axle\"",
        "link = \"left_arm_link\"\naxis_in_link = [0, 1, 0]",
    );
    let robot = warns(
        &edited(URDF, arm, "<mass value=\"0\"/>"),
        &alone,
        &["`left_arm_link` has no mass", "e-6 kg"],
    );
    let link = robot.links.iter().find(|link| link.name == "left_arm_link").unwrap();
    assert!(link.mass_kg < 1e-5);
}

#[test]
fn limits_are_put_right() {
    let limits = "lower=\"-1\" upper=\"2\"";
    let reversed = edited(URDF, limits, "lower=\"2\" upper=\"-1\"");
    let robot = warns(&reversed, SIDE, &["`left_hip`", "lower=\"2\" is above upper=\"-1\""]);
    assert_eq!(
        (joint(&robot, "left_hip").position_min_rad, joint(&robot, "left_hip").position_max_rad),
        (-1.0, 2.0)
    );
    for (missing, kind) in
        [("", "revolute"), (limits, "continuous"), ("lower=\"-100\" upper=\"100\"", "revolute")]
    {
        let endless = edited(URDF, limits, missing);
        let endless = edited(
            &endless,
            "name=\"left_hip\" type=\"revolute\"",
            &format!("name=\"left_hip\" type=\"{kind}\""),
        );
        let robot = warns(&endless, SIDE, &["`left_hip`", "±2π"]);
        let short = std::f64::consts::TAU - joint(&robot, "left_hip").position_max_rad;
        assert!((0.0..2e-6).contains(&short), "{short}");
        let narrowed = edited(
            SIDE,
            "nominal_rad = 0.7",
            "nominal_rad = 0.7, position_min_rad = -1, position_max_rad = 1",
        );
        let imported = good(&endless, &narrowed);
        assert_eq!(joint(&imported.robot, "left_hip").position_max_rad, 1.0);
        assert_eq!(imported.warnings, [""; 0]);
    }
}

#[test]
fn limits_in_degrees_are_named() {
    let limits = "lower=\"-1\" upper=\"2\"";
    let degrees = edited(URDF, limits, "lower=\"-60\" upper=\"110\"");
    warns(&degrees, SIDE, &["`left_hip`", "-60 to 110 rad", "give -1.047 to 1.920 rad"]);
}

#[test]
fn a_negative_moment_of_one_of_several_links_is_named() {
    let foot = "izz=\"0.0001\"/>
    </inertial>
  </link>
  <joint name=\"left_ankle\"";
    let negative = edited(URDF, foot, &foot.replace("0.0001", "-0.0001"));
    warns(
        &negative,
        SIDE,
        &["`left_shank`: a moment of inertia is -1.000e-4 kg·m²", "check the sign"],
    );
}

#[test]
fn motors_without_limits_get_documented_ones() {
    let knee = "lower=\"0.3\" upper=\"2.5\" velocity=\"12\" effort=\"20\"";
    let weight_n = good(URDF, SIDE).robot.total_mass_kg() * 9.806_65;
    for limits in ["", "velocity=\"0\" effort=\"0\"", "velocity=\"-1\" effort=\"-1\""] {
        let urdf = edited(URDF, knee, &format!("lower=\"0.3\" upper=\"2.5\" {limits}"));
        let robot = warns(&urdf, SIDE, &["`right_knee`", "`torque_max_nm`", "a default"]);
        warns(&urdf, SIDE, &["`right_knee`", "`speed_max_rad_s` is 10"]);
        let motor = &joint(&robot, "right_knee").actuator;
        assert_eq!(motor.speed_max_rad_s, 10.0);
        assert!((motor.torque_max_nm - 0.1 * weight_n).abs() < 1e-9);
        // If the URDF has no value, the side file's value is used without a warning.
        let side =
            edited(SIDE, "armature_kg_m2 = 0.01", "speed_max_rad_s = 9.0\ntorque_max_nm = 15.0");
        let motor = joint(&good(&urdf, &side).robot, "right_knee").actuator.clone();
        assert_eq!((motor.speed_max_rad_s, motor.torque_max_nm), (9.0, 15.0));
    }
}

#[test]
fn limits_beyond_every_drive_are_clamped() {
    let knee = "lower=\"0.3\" upper=\"2.5\" velocity=\"12\" effort=\"20\"";
    let far = "lower=\"0.3\" upper=\"2.5\" velocity=\"1000\" effort=\"1000\"";
    let urdf = edited(URDF, knee, far);
    let robot =
        warns(&urdf, SIDE, &["`right_knee`", "effort=\"1000\"", "162.000 N·m, the largest"]);
    warns(&urdf, SIDE, &["`right_knee`", "velocity=\"1000\"", "65.000 rad/s, the largest"]);
    let motor = &joint(&robot, "right_knee").actuator;
    assert_eq!((motor.speed_max_rad_s, motor.torque_max_nm), (65.0, 162.0));
    // Drives of the side file are weaker.
    let side = edited(
        SIDE,
        "armature_kg_m2 = 0.01",
        "armature_kg_m2 = 0.01\nspeed_max_rad_s = 9.0\ntorque_max_nm = 15.0",
    );
    let robot = warns(&urdf, &side, &["`right_knee`", "15.000 N·m, from [actuator.default]"]);
    let motor = &joint(&robot, "right_knee").actuator;
    assert_eq!((motor.speed_max_rad_s, motor.torque_max_nm), (9.0, 15.0));
    // A drive that the side file assigns to the joint needs no remark.
    let chosen = format!("[actuator.strong]\nspeed_max_rad_s = 8.0\ntorque_max_nm = 40.0\n{SIDE}");
    let chosen = edited(&chosen, "nominal_rad = 1.4", "nominal_rad = 1.4, actuator = \"strong\"");
    let made = good(&urdf, &chosen);
    assert_eq!(made.warnings, [""; 0]);
    assert_eq!(joint(&made.robot, "right_knee").actuator.torque_max_nm, 40.0);
}

#[test]
fn default_poses_are_next_to_zero() {
    let side = edited(SIDE, "left_knee = { nominal_rad = -1.4 }", "");
    let robot = warns(URDF, &side, &["`left_knee`", "no `nominal_rad`", "-0.3"]);
    assert_eq!(joint(&robot, "left_knee").nominal_rad, -0.3);
}

#[test]
fn a_missing_axis_is_x() {
    let robot =
        warns(&edited(URDF, "<axis xyz=\"0 2 0\"/>", ""), SIDE, &["`left_knee`", "[1, 0, 0]"]);
    assert_eq!(joint(&robot, "left_knee").axis_in_joint, nalgebra::Vector3::x());
}

#[test]
fn names_are_made_to_fit() {
    let long = "left/shank of the robot with a very long name";
    let urdf = URDF.replace("\"left_shank\"", &format!("\"{long}\""));
    let robot = warns(&urdf, SIDE, &[long, "`left_shank_of_the_robot_with_a_v`"]);
    assert!(robot.links.iter().any(|link| link.name == "left_shank_of_the_robot_with_a_v"));
    // Two names that become equal, and a robot name that is not a valid name.
    let urdf = URDF.replace("\"left_shank\"", "\"s é\"").replace("\"right_shank\"", "\"s è\"");
    let urdf = edited(&urdf, "robot name=\"rover\"", "robot name=\"the rover!\"");
    let robot = warns(&urdf, SIDE, &["`s è`", "`s___2`"]);
    assert_eq!(robot.name, "the_rover_");
}

#[test]
fn what_places_the_robot_in_the_world_is_no_part_of_it() {
    for kind in ["floating", "fixed", "planar"] {
        let world = format!(
            "<link name=\"world\"/><joint name=\"place\" type=\"{kind}\"><parent link=\"world\"/>\
             <child link=\"base_link\"/><origin xyz=\"1 2 3\" rpy=\"1 1 1\"/></joint><link name=\"base_link\"/>"
        );
        let urdf = edited(URDF, "<link name=\"base_link\"/>", &world);
        assert_eq!(good(&urdf, SIDE).robot, good(URDF, SIDE).robot, "{kind}");
    }
}

#[test]
fn a_root_of_choice_leaves_the_rest_out() {
    let urdf = edited(
        URDF,
        "<link name=\"base_link\"/>",
        "<link name=\"base_link\"/><link name=\"spare\"><inertial><mass value=\"2\"/></inertial></link>",
    );
    let side = format!("root = \"base_link\"\n{SIDE}");
    let robot = warns(&urdf, &side, &["`spare` with 2 kg is dropped"]);
    assert_eq!(robot, good(URDF, SIDE).robot);
}

#[test]
fn undeclared_prefixes_do_not_hurt() {
    let urdf = edited(
        URDF,
        "<link name=\"base_link\"/>",
        "<link name=\"base_link\"/><sensor:camera name=\"c\"/>",
    );
    assert_eq!(good(&urdf, SIDE).robot, good(URDF, SIDE).robot);
}

/// Tests that the worked example of the documentation imports, with its values.
#[test]
fn the_documented_side_file_imports() {
    let page = include_str!("../../../docs/urdf-import.md");
    let side = page.split("```toml\n").nth(1).and_then(|rest| rest.split("```").next()).unwrap();
    let robot = good(URDF, side).robot;
    assert_eq!(joint(&robot, "left_knee").position_max_rad, -0.4);
    assert_eq!(robot.end_effectors.len(), 3);
}

/// Tests that limbs beyond the four buses of a controller share the final bus.
#[test]
fn limbs_beyond_the_last_bus_share_it() {
    let link = |name: &str, mass: f64| {
        format!(
            r#"<link name="{name}"><inertial><mass value="{mass}"/>
            <inertia ixx="0.01" ixy="0" ixz="0" iyy="0.01" iyz="0" izz="0.01"/></inertial></link>"#
        )
    };
    let (mut urdf, mut side) = (link("body", 5.0), String::new());
    for leg in 0..10 {
        urdf += &link(&format!("leg{leg}"), 0.5);
        urdf += &format!(
            r#"<joint name="hip{leg}" type="revolute"><parent link="body"/><child link="leg{leg}"/>
            <origin xyz="{x} 0.1 0"/><axis xyz="0 1 0"/>
            <limit lower="-1" upper="1" velocity="12" effort="20"/></joint>"#,
            x = 0.1 * f64::from(leg),
        );
        side += &format!(
            "[[end_effector]]\nname = \"foot{leg}\"\ncontact = \"point_foot\"\nlink = \"leg{leg}\"\n\
             center_in_link_m = [0, 0, -0.2]\nradius_m = 0.02\nfriction_coefficient = 0.7\n"
        );
    }
    let robot = good(&format!("<robot name=\"centipede\">{urdf}</robot>"), &side).robot;
    let buses: Vec<_> = robot.joints.iter().map(|joint| joint.actuator.bus).collect();
    assert_eq!(buses, [0, 0, 1, 1, 2, 2, 3, 3, 3, 3]);
}
