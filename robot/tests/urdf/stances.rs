//! Tests of the standing pose, of the heading, and of limits and locks in the template.

use super::made::{CORNERS, KNEE, Made, WIDE, ball, contacts, imported, warned};
use rollwalk_robot::urdf::{Text, import, survey, survey_with};
use std::f64::consts::TAU;

/// Height of the lowest point of each end in the proposed pose, m.
fn bottoms(text: &str) -> Vec<f64> {
    let found = survey(Text { name: "made", text }).unwrap();
    found.end_effectors.iter().map(|end| end.center_m[2] - end.radius_m).collect()
}

fn are_level(bottoms: &[f64], within_m: f64) -> bool {
    let high = bottoms.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let low = bottoms.iter().copied().fold(f64::INFINITY, f64::min);
    high - low < within_m
}

#[test]
fn legs_behind_a_shared_joint_stand_and_the_shared_joint_stays() {
    for axis in [[0.0, 0.0, 1.0], [0.0, 1.0, 0.0], [1.0, 0.0, 0.0]] {
        let mut made = Made::trunk();
        made.link("pelvis", 3.0, [-0.1, 0.0, 0.0], 0.05, "");
        made.joint("revolute", ["waist", "trunk", "pelvis"], [-0.05, 0.0, 0.0], axis, WIDE);
        for (name, x, y) in CORNERS {
            let parent = if x > 0.0 { "trunk" } else { "pelvis" };
            made.leg(name, parent, [if x > 0.0 { x } else { x + 0.05 }, y, 0.0]);
        }
        let (found, robot) = imported(&made.urdf());
        assert_eq!(found.end_effectors.len(), 4);
        assert!(are_level(&bottoms(&made.urdf()), 1e-3), "{axis:?}: {:?}", bottoms(&made.urdf()));
        let waist = robot.joints.iter().find(|joint| joint.name == "waist").unwrap();
        assert_eq!(waist.nominal_rad, 0.0);
    }
}

/// Insect with legs that stand out from a round body.
fn insect(legs: usize) -> String {
    let mut made = Made::default();
    made.link("body", 1.0, [0.0; 3], 0.01, "");
    for leg in 0..legs {
        let angle = TAU * (leg as f64 + 0.25) / legs as f64;
        let name = |part: &str| format!("{part}_{leg}");
        let (out, across) = ([angle.cos(), angle.sin(), 0.0], [-angle.sin(), angle.cos(), 0.0]);
        let along = |length_m: f64| out.map(|part| part * length_m);
        for (part, length_m) in [("coxa", 0.02), ("femur", 0.04), ("tibia", 0.06)] {
            made.link(&name(part), 0.05, along(length_m), 5e-5, "");
        }
        made.link(&name("end"), 0.01, [0.0; 3], 1e-6, &ball(0.006, [0.0; 3]));
        made.joint(
            "revolute",
            [&name("yaw"), "body", &name("coxa")],
            along(0.08),
            [0.0, 0.0, 1.0],
            WIDE,
        );
        made.joint(
            "revolute",
            [&name("lift"), &name("coxa"), &name("femur")],
            along(0.04),
            across,
            WIDE,
        );
        made.joint(
            "revolute",
            [&name("knee"), &name("femur"), &name("tibia")],
            along(0.08),
            across,
            WIDE,
        );
        made.joint("fixed", [&name("tip"), &name("tibia"), &name("end")], along(0.12), across, "");
    }
    made.urdf()
}

#[test]
fn radial_legs_stand_in_their_own_planes() {
    for legs in [4, 5, 6, 8] {
        let text = insect(legs);
        let found = survey(Text { name: "made", text: &text }).unwrap();
        assert_eq!(found.end_effectors.len(), legs);
        for end in &found.end_effectors {
            let [x, y, z] = end.center_m;
            // Outside the second joint, at 0.12 m, and well below it.
            assert!(x.hypot(y) > 0.15 && z < -0.08, "{legs}: {end:?}");
        }
        assert!(are_level(&bottoms(&text), 1e-3), "{legs}: {:?}", bottoms(&text));
        // All of them fit a controller.
        imported(&text);
    }
}

/// Turns the root frame of a quadruped: x and y of the robot become the given axes.
fn turned(axes: [[f64; 3]; 3]) -> String {
    let turn = |[x, y, z]: [f64; 3]| -> [f64; 3] {
        std::array::from_fn(|row| axes[0][row] * x + axes[1][row] * y + axes[2][row] * z)
    };
    let mut made = Made::trunk();
    for (name, x, y) in CORNERS {
        let names = ["hip", "thigh", "shank"].map(|part| format!("{name}_{part}"));
        let [hip, thigh, shank] = names.each_ref().map(String::as_str);
        made.link(hip, 0.4, [0.0; 3], 8e-4, "");
        made.link(thigh, 0.6, turn([0.0, 0.0, -0.1]), 2e-3, "");
        made.link(shank, 0.2, turn([0.0, 0.0, -0.1]), 8e-4, &ball(0.02, turn([0.0, 0.0, -0.2])));
        let joint = |part: &str| format!("{name}_{part}_joint");
        made.joint(
            "revolute",
            [&joint("roll"), "trunk", hip],
            turn([x, y, 0.0]),
            turn([1.0, 0.0, 0.0]),
            WIDE,
        );
        made.joint(
            "revolute",
            [&joint("pitch"), hip, thigh],
            [0.0; 3],
            turn([0.0, 1.0, 0.0]),
            WIDE,
        );
        made.joint(
            "revolute",
            [&joint("knee"), thigh, shank],
            turn([0.0, 0.0, -0.2]),
            turn([0.0, 1.0, 0.0]),
            KNEE,
        );
    }
    made.urdf()
}

#[test]
fn axes_of_the_root_follow_from_names_and_knees() {
    let (x, y, z) = ([1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]);
    let minus = |axis: [f64; 3]| axis.map(|part| -part);
    let straight = survey(Text { name: "made", text: &turned([x, y, z]) }).unwrap();
    assert_eq!(
        (straight.axes, straight.warnings.len()),
        (["+x", "+z"], 0),
        "{:?}",
        straight.warnings
    );
    for (axes, words) in [
        ([y, minus(x), z], ["+y", "+z"]),
        ([minus(x), minus(y), z], ["-x", "+z"]),
        ([x, minus(z), y], ["+x", "+y"]),
        ([z, x, y], ["+z", "+y"]),
    ] {
        let text = turned(axes);
        let (found, robot) = imported(&text);
        assert_eq!(found.axes, words);
        let proposal = format!("forward = \"{}\"", words[0]);
        assert!(warned(&found, &[&proposal]), "{:?}", found.warnings);
        for end in &robot.end_effectors {
            let link = &robot.links[end.link].name;
            let expected = [
                ("LF", "front_left"),
                ("RF", "front_right"),
                ("LH", "rear_left"),
                ("RH", "rear_right"),
            ];
            let corner = expected.iter().find(|(leg, _)| link.starts_with(leg)).unwrap().1;
            assert_eq!(end.name, corner, "{words:?}");
        }
        // If names reveal nothing, the axis of the knees remains, if z is up.
        let plain = ["LF", "RF", "LH", "RH"].iter().zip(["a", "b", "c", "d"]);
        let plain = plain
            .fold(text, |text, (leg, name)| text.replace(&format!("{leg}_"), &format!("{name}_")));
        let found = survey(Text { name: "made", text: &plain }).unwrap();
        assert_eq!(found.axes[0][1..], words[0][1..], "{words:?}");
        assert_eq!(found.axes[1], words[1]);
    }
}

#[test]
fn a_given_side_file_replaces_guesses_in_the_template() {
    let text = turned([[0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]);
    let urdf = Text { name: "made", text: &text };
    let given = "name = \"mine\"\nforward = \"+y\"\n[actuator.default]\narmature_kg_m2 = 0.02\n[actuator.strong]\ntorque_max_nm = 30.0\n\
                 [lock]\nLF_roll_joint = 0.1\n[joint]\nRF_roll_joint = { nominal_rad = 0.2, actuator = \"strong\" }\n";
    let found = survey_with(urdf, Text { name: "given", text: given }).unwrap();
    let robot = import(urdf, Text { name: "template", text: &found.template }).unwrap().robot;
    assert_eq!((robot.name.as_str(), robot.joints.len()), ("mine", 11));
    let joint = robot.joints.iter().find(|joint| joint.name == "RF_roll_joint").unwrap();
    assert_eq!((joint.nominal_rad, joint.actuator.torque_max_nm), (0.2, 30.0));
    assert_eq!(joint.actuator.armature_kg_m2, 0.02);
    let wrong = survey_with(urdf, Text { name: "given", text: "forward = \"+w\"" }).unwrap_err();
    assert_eq!(wrong.file_name(), "given");
}

#[test]
fn limits_in_degrees_are_converted_in_the_template() {
    let degrees = |limits: &str, new: &str| {
        let made = Made::quadruped().urdf();
        made.replace(WIDE, "lower=\"-90\" upper=\"90\" effort=\"12\" velocity=\"9\"")
            .replace(limits, new)
    };
    let text = degrees(KNEE, "lower=\"-150\" upper=\"-20\" effort=\"12\" velocity=\"9\"");
    let (found, robot) = imported(&text);
    assert!(warned(&found, &["`LF_roll`", "look like degrees"]), "{:?}", found.warnings);
    let knee = robot.joints.iter().find(|joint| joint.name == "LF_knee").unwrap();
    assert!((knee.position_min_rad - -150_f64.to_radians()).abs() < 1e-9);
    assert!((knee.position_max_rad - -20_f64.to_radians()).abs() < 1e-9);
    assert!(are_level(&bottoms(&text), 1e-3));
}

/// Elements of a leg with a differential at the hip and a belt to the knee, in the forms of ROS 1 and of ros2_control.
const COUPLED: &str = "<transmission name=\"hip\"><type>transmission_interface/DifferentialTransmission</type>\
    <joint name=\"LF_pitch\"><role>joint2</role></joint>\
    <joint name=\"LF_roll\"><role>joint1</role><mechanicalReduction>1.5</mechanicalReduction></joint>\
    <actuator name=\"a\"><role>actuator1</role><mechanicalReduction>9</mechanicalReduction></actuator></transmission>\
    <ros2_control name=\"rf\" type=\"system\"><transmission name=\"knee\">\
    <plugin>transmission_interface/FourBarLinkageTransmission</plugin>\
    <joint name=\"RF_pitch\" role=\"joint1\"/>\
    <joint name=\"RF_knee\" role=\"joint2\"><mechanical_reduction>-0.8</mechanical_reduction></joint>\
    </transmission></ros2_control></robot>";

#[test]
fn transmissions_couple_the_motors_of_two_joints() {
    let text = Made::quadruped().urdf().replace("</robot>", COUPLED);
    let (_, robot) = imported(&text);
    let joint = |name: &str| robot.joints.iter().find(|joint| joint.name == name).unwrap();
    let ratios = |name: &str| -> Vec<_> {
        let ratios = joint(name).motor_per_joint.iter();
        let mut found: Vec<_> =
            ratios.map(|of| (robot.joints[of.joint].name.as_str(), of.ratio)).collect();
        found.sort_by(|a, b| a.0.cmp(b.0));
        found
    };
    assert_eq!(ratios("LF_roll"), [("LF_pitch", 1.0), ("LF_roll", 1.5)]);
    assert_eq!(ratios("LF_pitch"), [("LF_pitch", -1.0), ("LF_roll", 1.5)]);
    assert_eq!(ratios("RF_knee"), [("RF_knee", -0.8), ("RF_pitch", 1.0)]);
    assert_eq!(ratios("RF_pitch"), []);
    // The joints have 12 N·m and 9 rad/s. Two motors share the load of a joint at a differential.
    let limits = |name: &str| {
        let motor = &joint(name).actuator;
        [motor.torque_max_nm, motor.speed_max_rad_s].map(|limit| (limit * 1e6).round() / 1e6)
    };
    assert_eq!((limits("LF_roll"), limits("LF_pitch")), ([4.0, 13.5], [6.0, 9.0]));
    assert_eq!((limits("RF_pitch"), limits("RF_knee")), ([12.0, 9.0], [15.0, 7.2]));
}

#[test]
fn dampers_of_a_urdf_are_those_of_their_joints() {
    let damped = "<dynamics damping=\"0.3\" friction=\"0.2\"/></joint>";
    let text = Made::quadruped().urdf().replacen("</joint>", damped, 1);
    let (_, robot) = imported(&text);
    let dampers: Vec<_> = robot.joints.iter().filter_map(|joint| joint.spring).collect();
    assert_eq!(dampers.len(), 1);
    assert_eq!((dampers[0].stiffness_nm_rad, dampers[0].damping_nm_s_rad), (0.0, 0.3));
}

#[test]
fn a_damping_beyond_that_of_any_robot_is_dropped() {
    let made = Made::quadruped().urdf();
    let text = made.replacen("</joint>", "<dynamics damping=\"1e3\"/></joint>", 1);
    let (found, robot) = imported(&text);
    assert!(robot.joints.iter().all(|joint| joint.spring.is_none()));
    let side = Text { name: "side.toml", text: &found.template };
    let warnings = import(Text { name: "robot.urdf", text: &text }, side).unwrap().warnings;
    let is_named = |w: &String| w.contains("its damping of 1000.0 N·m·s/rad is dropped");
    assert!(warnings.iter().any(is_named), "{warnings:?}");
}

#[test]
fn blank_limits_are_named() {
    let made = Made::quadruped().urdf();
    let text = made.replace(WIDE, "lower=\"0\" upper=\"0\" effort=\"0\" velocity=\"0\"");
    let (found, _) = imported(&text);
    assert!(
        warned(&found, &["`LF_roll`, `LF_pitch`", "and 4 more", "limits are 0"]),
        "{:?}",
        found.warnings
    );
    assert_eq!(contacts(&found).len(), 4);
}

#[test]
fn couplings_and_loops_of_a_urdf_are_named() {
    let made = Made::quadruped().urdf();
    let with = |element: &str| made.replace("</robot>", &format!("{element}</robot>"));
    let simple = "<transmission name=\"t\"><type>transmission_interface/SimpleTransmission</type><joint name=\"LF_roll\"/>\
                  <actuator name=\"m\"><mechanicalReduction>1</mechanicalReduction></actuator></transmission>";
    let of = |text: &str| survey(Text { name: "made", text }).unwrap();
    assert_eq!(of(&with(simple)).warnings, [""; 0]);
    let geared = simple.replace(">1<", ">9<");
    assert!(warned(&of(&with(&geared)), &["<transmission> `t`"]));
    let coupled = simple.replace("Simple", "Differential");
    assert!(warned(&of(&with(&coupled)), &["<transmission> `t`"]));
    let two = coupled.replace("<actuator", "<joint name=\"LF_pitch\"/><actuator");
    assert!(warned(&of(&with(&two)), &["<transmission> `t`", "the motors turn both joints"]));
    let other = two.replace("Differential", "Other");
    assert!(warned(&of(&with(&other)), &["<transmission> `t`", "write `motor_per_joint`"]));
    let looped = "<gazebo><joint name=\"rod\" type=\"revolute\"><parent>LF_shank</parent><child>LF_thigh</child></joint></gazebo>";
    assert!(warned(&of(&with(looped)), &["<joint> `rod`", "closes a loop"]));
    let mimic = made.replacen("</joint>", "<mimic joint=\"RF_roll\"/></joint>", 1);
    assert!(warned(&of(&mimic), &["`LF_roll`", "<mimic>", "locks"]));
}
