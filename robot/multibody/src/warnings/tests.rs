//! Tests that typical errors in robot files give their warning, and that shipped robots give none.

use super::warnings;
use crate::{Standing, Tree};
use rollwalk_robot::{Contact, Robot};

const PUP: &str = include_str!("../../../../shipped/robots/pup.toml");

fn of(text: &str) -> Vec<String> {
    let robot = Robot::from_toml("robot.toml", text).unwrap();
    let tree = Tree::new(&robot);
    warnings(&tree, &Standing::new(&tree).unwrap())
}

#[test]
fn robots_that_ship_raise_none() {
    for entry in std::fs::read_dir("../../shipped/robots").unwrap() {
        let path = entry.unwrap().path();
        let name = path.file_stem().unwrap().to_string_lossy().into_owned();
        let Ok(text) = std::fs::read_to_string(&path) else { continue };
        // The wheels are tilted as far as a design can repair.
        if path.extension().is_none_or(|of| of != "toml") || name == "car_tilted" {
            continue;
        }
        assert_eq!(of(&text), [""; 0], "{name}");
    }
}

/// Robot file of one link on four feet, with text replacements.
fn table(changes: &[(&str, &str)]) -> String {
    let mut text = r#"
name = "table"

[actuator.servo]
model = "servo"
speed_max_rad_s = 6.0
torque_max_nm = 3.0
kp_nm_rad = 60.0
kd_nm_s_rad = 0.8
armature_kg_m2 = 0.004

[[link]]
name = "body"
parts = [{ mass_kg = 1.5, at_m = [0.0, 0.0, 0.0], box_m = [0.30, 0.16, 0.06] }]

[[template.leg.link]]
name = "*_thigh"
parts = [{ mass_kg = 0.15, at_m = [0.0, 0.0, -0.05], box_m = [0.03, 0.03, 0.10] }]

[[template.leg.link]]
name = "*_shank"
parts = [{ mass_kg = 0.20, at_m = [0.0, 0.0, -0.08], box_m = [0.03, 0.03, 0.10] }]

[[template.leg.joint]]
name = "*_hip"
parent = "mount"
child = "*_thigh"
origin_in_parent_m = [0.0, 0.0, 0.0]
axis_in_joint = [0.0, 1.0, 0.0]
position_min_rad = -0.5
position_max_rad = 1.5
nominal_rad = 0.6
actuator = "servo"

[[template.leg.joint]]
name = "*_knee"
parent = "*_thigh"
child = "*_shank"
origin_in_parent_m = [0.0, 0.0, -0.10]
axis_in_joint = [0.0, 1.0, 0.0] # knee
position_min_rad = -2.2
position_max_rad = -0.2
nominal_rad = -1.2
actuator = "servo"

[[template.leg.end_effector]]
name = "*"
link = "*_shank"
center_in_link_m = [0.0, 0.0, -0.10]
radius_m = 0.04
friction_coefficient = 0.8
contact = "passive_wheel"
axis_in_link = [0.0, 1.0, 0.0] # wheel
rolling_resistance = 0.01
rolling_drag_s_m = 0.0
"#
    .to_owned();
    for (name, x, y) in [
        ("front_left", 0.13, 0.1),
        ("front_right", 0.13, -0.1),
        ("rear_left", -0.13, 0.1),
        ("rear_right", -0.13, -0.1),
    ] {
        let side = if y > 0.0 { "left" } else { "right" };
        let first_id = 1 + 2 * text.matches("[[limb]]").count();
        text += &format!(
            "\n[[limb]]\nname = \"{name}\"\ntemplate = \"leg\"\nparent = \"body\"\norigin_in_parent_m = [{x}, {y}, 0.0]\nside = \"{side}\"\nbus = 0\nfirst_id = {first_id}\n"
        );
    }
    for (from, to) in changes {
        assert!(text.contains(from), "{from}");
        text = text.replace(from, to);
    }
    text
}

#[test]
fn a_slip_is_named_with_its_value() {
    let body = "parts = [{ mass_kg = 1.5, at_m = [0.0, 0.0, 0.0], box_m = [0.30, 0.16, 0.06] }]";
    let inertia = |diagonal: [f64; 3]| {
        format!(
            "mass_kg = 1.5\ncom_in_link_m = [0, 0, 0]\ninertia_in_link_kg_m2 = [{}, {}, {}, 0, 0, 0]",
            diagonal[0], diagonal[1], diagonal[2]
        )
    };
    assert_eq!(of(&table(&[])), [""; 0]);
    let (g_mm2, kg_mm2) = (inertia([3.65e6, 1.17e7, 1.44e7]), inertia([3650.0, 11700.0, 14400.0]));
    let (g_m2, point) = (inertia([3.65, 11.7, 14.4]), inertia([1e-7, 1e-7, 1e-7]));
    let cases: [(Vec<(&str, &str)>, &str); 26] = [
        (vec![(body, &g_mm2)], "link `body`: an inertia of 14400000.000 kg·m²"),
        (vec![(body, &g_mm2)], "; multiply an inertia in g·mm² by 1e-9"),
        (vec![(body, &kg_mm2)], " in kg·mm² by 1e-6"),
        (vec![(body, &g_m2)], " in g·m² by 1e-3"),
        (vec![(body, &point)], "a radius of gyration of only 0.26 mm"),
        (
            vec![("mass_kg = 1.5,", "mass_kg = 0.0015,")],
            "link `body`: mass 0.0015 kg and inertia are those of a box of 2880.0 cm³ with a density of 0.52 kg/m³",
        ),
        (
            vec![("mass_kg = 0.15,", "mass_kg = 150,")],
            "`rear_right_thigh`: mass 150 kg and inertia are those of a box of 90.0 cm³ with a density of 1666667 kg/m³",
        ),
        (vec![("armature_kg_m2 = 0.004", "armature_kg_m2 = 0.4")], "`armature_kg_m2` is 0.4, "),
        (vec![("armature_kg_m2 = 0.004", "armature_kg_m2 = 4.0")], "`armature_kg_m2` is 4, "),
        (vec![("kp_nm_rad = 60.0", "kp_nm_rad = 1.1")], "`kp_nm_rad` is 1.1, too low to carry"),
        (
            vec![("kd_nm_s_rad = 0.8", "kd_nm_s_rad = 40")],
            "`kd_nm_s_rad` is 40, unstable in a loop",
        ),
        (
            vec![("kd_nm_s_rad = 0.8", "kd_nm_s_rad = 8")],
            "`kd_nm_s_rad` is 8, so that errors of the joint decay in 0.13 s with `kp_nm_rad` 60",
        ),
        (
            vec![("kd_nm_s_rad = 0.8", "kd_nm_s_rad = 5.4"), SERVO_LINE],
            "`kd_nm_s_rad` is 5.4, so that the joint lags by 0.09 s with `kp_nm_rad` 60",
        ),
        (
            vec![
                (
                    "name = \"table\"\n",
                    "name = \"table\"\n\n[[bus]]\nnumber = 0\nprotocol = \"rollwalk\"\n",
                ),
                ("bus = 0\nfirst_id = 7", "bus = 1\nfirst_id = 7"),
            ],
            "motors `rear_right_hip`, `rear_right_knee`: on bus 1, which has no [[bus]]",
        ),
        (
            vec![("[0.0, 1.0, 0.0] # wheel", "[1.0, 0.0, 0.0]")],
            "`rear_right`: axis points forward, so no wheel",
        ),
        (
            vec![("[0.0, 0.0, -0.10]\naxis_in_joint", "[0.0, 0.0, 0.0]\naxis_in_joint")],
            "joints `front_left_knee`, `front_right_knee`, `rear_left_knee`, `rear_right_knee`: axis coincides with the axis of the previous joint",
        ),
        (
            vec![("center_in_link_m = [0.0, 0.0, -0.10]", "center_in_link_m = [0.0, 0.01, 0.0]")],
            "`rear_right`: contact lies on the axis of the last joint, `rear_right_knee`, which",
        ),
        (vec![("[0.0, 1.0, 0.0] # wheel", "[0.0, 0.3, 1.0]")], "`rear_right`: axis is 52° from"),
        (vec![("radius_m = 0.04", "radius_m = 0.14")], "`front_left`, `rear_left`"),
        (
            vec![("[0.0, 1.0, 0.0] # knee", "[0.0, -1.0, 0.0]")],
            "`rear_left`, `rear_right`: almost no load",
        ),
        (
            vec![
                ("[0.13, 0.1, 0.0]", "[0.13, -0.1, 0.0]"),
                ("name = \"front_right\"", "name = \"f\""),
            ],
            "end effector `front_left`: left or right according to the name, but positioned on the opposite side",
        ),
        (
            vec![
                ("\"front_left\"", "\"x\""),
                ("\"rear_left\"", "\"front_left\""),
                ("\"x\"", "\"rear_left\""),
            ],
            "`rear_left`, `front_left`: front or rear according to the name",
        ),
        (
            vec![
                ("0.13, 0.1,", "0.13, 0.2,"),
                ("0.13, -0.1,", "0.13, 0.1,"),
                ("0.13, 0.2,", "0.13, -0.1,"),
            ],
            "`rear_left`, `rear_right`: left or right according to the name",
        ),
        (vec![("\"front_left\"", "\"HR_FOOT\"")], "`HR_FOOT`: front or rear according to the name"),
        (vec![("\"front_left\"", "\"footR\"")], "`footR`: left or right according to the name"),
        (vec![("\"front_left\"", "\"RF2\"")], "`RF2`: left or right according to the name"),
    ];
    for (changes, expected) in cases {
        let found = of(&table(&changes));
        assert!(found.iter().any(|warning| warning.contains(expected)), "{expected}: {found:#?}");
    }
    assert_eq!(of(PUP), [""; 0]);
}

/// Bus whose protocol has no speed in the set-points of joints.
const SERVO_LINE: (&str, &str) = (
    "name = \"table\"\n",
    "name = \"table\"\n\n[[bus]]\nnumber = 0\nprotocol = \"dynamixel\"\nmodel = \"XM430-W210\"\nbit_rate = 1000000\nreturn_delay_us = 20\nwatchdog_ms = 100\n",
);

/// Damping holds no joint back if set-points have a speed. A servo with gears of 1:345 has a large armature.
#[test]
fn real_gains_and_armatures_raise_none() {
    let strong = ("kd_nm_s_rad = 0.8", "kd_nm_s_rad = 5.4");
    assert_eq!(of(&table(&[strong])), [""; 0]);
    let on_controller =
        (SERVO_LINE.0, &*SERVO_LINE.1.replace("return", "control = \"on_controller\"\nreturn"));
    assert_eq!(of(&table(&[strong, on_controller])), [""; 0]);
    // STS3215 at 7.4 V, identified by https://github.com/Rhoban/bam, on a leg with a twentieth of its armature.
    let changes = [
        ("speed_max_rad_s = 6.0", "speed_max_rad_s = 3.5"),
        ("torque_max_nm = 3.0", "torque_max_nm = 1.1"),
        ("kp_nm_rad = 60.0", "kp_nm_rad = 17.8"),
        ("kd_nm_s_rad = 0.8", "kd_nm_s_rad = 0.6"),
        ("armature_kg_m2 = 0.004", "armature_kg_m2 = 0.028"),
    ];
    assert_eq!(of(&table(&changes)), [""; 0]);
}

/// Inertias are compared with the size of their link, and counted. The frame of the body is arbitrary.
#[test]
fn implausible_inertias_are_counted_wherever_the_frame_is() {
    let leg = "parts = [{ mass_kg = 0.15, at_m = [0.0, 0.0, -0.05], box_m = [0.03, 0.03, 0.10] }]";
    let huge = "mass_kg = 0.15\ncom_in_link_m = [0, 0, -0.05]\ninertia_in_link_kg_m2 = [0.02, 0.02, 0.01, 0, 0, 0]";
    let warnings = of(&table(&[(leg, huge)]));
    assert!(
        warnings[0].contains("robot `table`: 4 of 9 links have an implausible inertia"),
        "{warnings:#?}"
    );
    assert!(
        warnings[1].contains("`front_left_thigh`") && warnings[1].contains("on a link of 0.1"),
        "{warnings:#?}"
    );
    for shift_m in [[0.0, 0.0, 0.5], [0.5, -0.5, -0.5]] {
        let mut robot = Robot::from_toml("robot.toml", &table(&[(leg, huge)])).unwrap();
        let shift = nalgebra::Vector3::from(shift_m);
        robot.links[0].com_in_link_m += shift;
        let on_body = robot.joints.iter_mut().filter(|joint| joint.parent == 0);
        on_body.for_each(|joint| joint.parent_from_joint.translation.vector += shift);
        let tree = Tree::new(&robot);
        let shifted = super::warnings(&tree, &Standing::new(&tree).unwrap());
        assert_eq!(shifted, warnings, "{shift_m:?}");
    }
}

#[test]
fn parts_beyond_the_contact_or_behind_the_joint_are_named() {
    let has = |changes: &[(&str, &str)], words: &[&str]| {
        let warnings = of(&table(changes));
        let has_all = |warning: &&String| words.iter().all(|word| warning.contains(word));
        assert!(warnings.iter().any(|warning| has_all(&warning)), "{words:?}: {warnings:#?}");
    };
    let on_thigh = ("link = \"*_shank\"", "link = \"*_thigh\"");
    let words = ["`front_left_knee`", "moves no contact", "is on link `front_left_thigh`"];
    has(&[on_thigh], &words);
    let above = ("at_m = [0.0, 0.0, -0.08]", "at_m = [0.0, 0.0, 0.08]");
    has(&[above], &["`front_left_shank`", "is behind its joint", "sign of `at_m`"]);
}

/// A driven wheel holds no angle.
#[test]
fn stiffness_of_a_wheel_is_named() {
    let drive = "kp_nm_rad = 0.0";
    assert!(PUP.contains(drive));
    let warnings = of(&PUP.replace(drive, "kp_nm_rad = 12.0"));
    let words = "`kp_nm_rad` of the wheel's actuator is 12 N·m/rad";
    assert!(warnings.iter().any(|warning| warning.contains(words)), "{warnings:#?}");
}

#[test]
fn a_joint_that_never_moves_its_contact_is_named() {
    // The knee rotates about the line from its origin to the foot, which would steer a wheel.
    let along = ("[0.0, 1.0, 0.0] # knee", "[0.0, 0.0, 1.0]");
    let mut robot = Robot::from_toml("robot.toml", &table(&[along])).unwrap();
    robot.end_effectors.iter_mut().for_each(|end| end.contact = Contact::PointFoot);
    let tree = Tree::new(&robot);
    let warnings = warnings(&tree, &Standing::new(&tree).unwrap());
    let words = "`rear_right`: contact lies on the axis of the last joint, `rear_right_knee`";
    assert!(warnings.iter().any(|warning| warning.contains(words)), "{warnings:#?}");
}
