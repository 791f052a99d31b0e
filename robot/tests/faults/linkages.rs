//! Tests of servos with crank and rod: closed forms of four-bar and five-bar linkages, derivatives, and faults.

use super::*;
use rollwalk_robot::Transmission;
use std::f64::consts::FRAC_PI_2;

/// Robot with two joints in a row about y: `shoulder` to an arm of 0.2 m, `elbow` to a hand. The servo of the elbow has a crank.
fn linked(linkage: &str) -> String {
    let elbow = r#"[[joint]]
name = "elbow"
parent = "arm"
child = "hand"
origin_in_parent_m = [0.0, 0.0, -0.2]
axis_in_joint = [0.0, 1.0, 0.0]
position_min_rad = -1.9
position_max_rad = -1.1
nominal_rad = -1.5707963267948966
actuator = "servo"
bus = 0
id = 3
linkage = LINKAGE

[[link]]
name = "hand"
mass_kg = 0.1
com_in_link_m = [0.0, 0.0, 0.0]
inertia_in_link_kg_m2 = [0.001, 0.001, 0.001, 0.0, 0.0, 0.0]

[[end_effector]]"#;
    ROBOT
        .replacen("[[end_effector]]", &elbow.replace("LINKAGE", linkage), 1)
        .replacen("origin_rpy_rad = [0.0, 0.1, 0.0]\n", "", 1)
        .replacen(
            "position_min_rad = -1.0\nposition_max_rad = 1.0",
            "position_min_rad = -0.3\nposition_max_rad = 0.3",
            1,
        )
}

/// Crank on the arm at the shoulder, parallel to the lever of the hand.
const PARALLELOGRAM: &str = "{ motor_on = \"arm\", pivot_m = [0.0, 0.0, 0.0], pin_m = [0.04, 0.0, 0.0], rod_end_m = [0.0, 0.0, -0.04], motor_nominal_rad = 0.5 }";
/// Crank on the arm with other lengths: base 0.2 m, crank 0.05 m, rod and lever 0.03 m.
const FOUR_BAR: &str = "{ motor_on = \"arm\", pivot_m = [0.0, 0.0, 0.0], pin_m = [0.05, 0.0, 0.0], rod_end_m = [0.0, 0.0, -0.03] }";
/// Crank on the body, so that shoulder and elbow turn it.
const FIVE_BAR: &str = "{ motor_on = \"body\", pivot_m = [0.12, 0.0, 0.01], pin_m = [0.24, 0.0, -0.05], rod_end_m = [0.0, 0.0, -0.09] }";

fn robot(linkage: &str) -> Robot {
    Robot::from_toml("linked.toml", &linked(linkage)).unwrap()
}

fn index(robot: &Robot, name: &str) -> usize {
    robot.joints.iter().position(|joint| joint.name == name).unwrap()
}

/// Nominal joint angles, except the given angles of shoulder and elbow.
fn angles(robot: &Robot, [shoulder, elbow]: [f64; 2]) -> Vec<f64> {
    let mut angles: Vec<_> = robot.joints.iter().map(|joint| joint.nominal_rad).collect();
    angles[index(robot, "shoulder")] = shoulder;
    angles[index(robot, "elbow")] = elbow;
    angles
}

const POSES: [[f64; 2]; 5] = [[0.0, -1.5], [0.2, -1.2], [-0.3, -1.8], [0.3, -1.1], [-0.1, -1.9]];

#[test]
fn a_parallelogram_turns_its_servo_by_the_angle_of_the_joint() {
    let robot = robot(PARALLELOGRAM);
    let (elbow, map) = (index(&robot, "elbow"), robot.transmission());
    for pose in POSES {
        let angles = angles(&robot, pose);
        let motor_rad = map.motors(&angles)[elbow];
        assert!((motor_rad - (0.5 + pose[1] + FRAC_PI_2)).abs() < 1e-12, "{motor_rad}");
        let ratios = map.at(&angles);
        assert!((ratios.ratios(elbow)[0].ratio - 1.0).abs() < 1e-12);
        assert!(ratios.bends(elbow).iter().all(|(.., by)| by.abs() < 1e-11), "{ratios:?}");
    }
}

#[test]
fn a_four_bar_has_the_angles_of_freudenstein() {
    let robot = robot(FOUR_BAR);
    let (elbow, map) = (index(&robot, "elbow"), robot.transmission());
    // Angles from the base line, which leads from the pivot to the elbow; the nominal crank and lever are square to it.
    let (base, crank, lever) = (0.2, 0.05, 0.03);
    let rod_squared: f64 = base * base + (crank - lever) * (crank - lever);
    let k = (base * base + crank * crank + lever * lever - rod_squared) / (2.0 * crank * lever);
    for pose in POSES {
        let motor_rad = map.motors(&angles(&robot, pose))[elbow] - FRAC_PI_2;
        let lever_rad = pose[1];
        let freudenstein = base / lever * motor_rad.cos() - base / crank * lever_rad.cos() - k
            + (motor_rad - lever_rad).cos();
        assert!(freudenstein.abs() < 1e-12, "{pose:?}: {freudenstein}");
    }
}

#[test]
fn a_five_bar_keeps_the_length_of_its_rod() {
    let robot = robot(FIVE_BAR);
    let (elbow, map) = (index(&robot, "elbow"), robot.transmission());
    let turned = |angle: f64, [x, z]: [f64; 2]| {
        [x * angle.cos() + z * angle.sin(), z * angle.cos() - x * angle.sin()]
    };
    let rod_m = |pose: [f64; 2]| {
        let motor_rad = map.motors(&angles(&robot, pose))[elbow];
        let arm = turned(pose[0], [0.0, -0.2]);
        let hand = turned(pose[0] + pose[1], [0.0, -0.09]);
        let crank = turned(motor_rad, [0.12, -0.06]);
        let apart = [0.1 + arm[0] + hand[0] - 0.12 - crank[0], arm[1] + hand[1] - 0.01 - crank[1]];
        apart[0].hypot(apart[1])
    };
    let nominal = [0.0, -FRAC_PI_2];
    for pose in POSES {
        assert!((rod_m(pose) - rod_m(nominal)).abs() < 1e-14, "{pose:?}");
    }
    assert!(map.motors(&angles(&robot, nominal))[elbow].abs() < 1e-14, "the nominal pose");
}

#[test]
fn derivatives_of_linkages_are_those_of_differences() {
    for linkage in [FOUR_BAR, FIVE_BAR] {
        let robot = robot(linkage);
        let (elbow, map) = (index(&robot, "elbow"), robot.transmission());
        for pose in POSES {
            let here = angles(&robot, pose);
            let ratios = map.at(&here);
            let ratio = |of: &[rollwalk_robot::JointRatio], joint: usize| {
                of.iter().find(|of| of.joint == joint).map_or(0.0, |of| of.ratio)
            };
            for joint in 0..robot.joints.len() {
                let step = 1e-5;
                let [plus, minus] = [step, -step].map(|by| {
                    let mut moved = here.clone();
                    moved[joint] += by;
                    (map.motors(&moved)[elbow], map.at(&moved).into_owned())
                });
                let slope = (plus.0 - minus.0) / (2.0 * step);
                // Truncation is about step², rounding about 1e-16 / step.
                assert!((slope - ratio(ratios.ratios(elbow), joint)).abs() < 1e-8, "{pose:?}");
                for other in 0..robot.joints.len() {
                    let [plus, minus] =
                        [&plus.1, &minus.1].map(|at| ratio(at.ratios(elbow), other));
                    let bend = (plus - minus) / (2.0 * step);
                    let bends = ratios.bends(elbow).iter();
                    let found: f64 = bends
                        .filter(|(j, k, _)| (*j, *k) == (joint, other))
                        .map(|(.., by)| by)
                        .sum();
                    assert!((bend - found).abs() < 1e-6, "{pose:?}: {bend} {found}");
                }
            }
            // Motor angles give the joint angles back.
            for (back, angle) in map.joints(&map.motors(&here)).iter().zip(&here) {
                assert!((back - angle).abs() < 1e-10, "{pose:?}: {back} {angle}");
            }
        }
    }
}

#[test]
fn servos_with_linkages_have_the_range_of_their_joints() {
    let robot = robot(PARALLELOGRAM);
    let elbow = index(&robot, "elbow");
    let channel = robot.controller_config().unwrap().channels[elbow];
    let off_rad = 0.5 + FRAC_PI_2;
    assert!((f64::from(channel.min) - (off_rad - 1.9)).abs() < 1e-6, "{}", channel.min);
    assert!((f64::from(channel.max) - (off_rad - 1.1)).abs() < 1e-6, "{}", channel.max);
}

#[test]
fn linkages_that_cannot_be() {
    for (linkage, problem, help) in [
        (PARALLELOGRAM.replace("\"arm\"", "\"hand\""), "cannot turn the joint", "the parent"),
        (PARALLELOGRAM.replace("\"arm\"", "\"leg\""), "no link `leg`", "arm"),
        (PARALLELOGRAM.replace("0.04, 0.0, 0.0]", "0.0, 0.0, 0.0]"), "cannot turn", "the pin away"),
        (PARALLELOGRAM.replace("-0.04", "-15.0"), "`rod_end_m` is [0, 0, -15]", "millimetres"),
        (PARALLELOGRAM.replace("0.5", "90.0"), "`motor_nominal_rad` is 90 rad", "within ±2π"),
        (PARALLELOGRAM.replace(" }", ", axis = [0, 0, 0] }"), "`axis` is zero", "direction"),
        (
            PARALLELOGRAM.replace("[0.04, 0.0, 0.0]", "[0.0353, 0.0, -0.0188]"),
            "has crank and rod nearly in line at elbow = ",
            "narrow the limits",
        ),
        (
            PARALLELOGRAM.replace("[0.04, 0.0, 0.0]", "[0.01, 0.0, 0.0]"),
            "does not close at elbow = ",
            "narrow the limits",
        ),
    ] {
        let error = Robot::from_toml("linked.toml", &linked(&linkage)).unwrap_err();
        let fault = error.faults().next().unwrap();
        assert!(fault.message.contains(problem), "{linkage}: {}", fault.message);
        assert!(fault.help.contains(help), "{linkage}: {}", fault.help);
    }
    let mut both = robot(PARALLELOGRAM);
    let elbow = index(&both, "elbow");
    both.joints[elbow].motor_per_joint =
        vec![rollwalk_robot::JointRatio { joint: elbow, ratio: 2.0 }];
    assert!(both.validate().unwrap_err().to_string().contains("beside `motor_per_joint`"));
    assert!(Transmission::new(&robot(FIVE_BAR)).unwrap().has_linkages());
}
