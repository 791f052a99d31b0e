//! Tests that imported robots have the masses of the URDF, and its geometry at any joint angles.

use super::oracle::{Truth, truth};
use super::{SIDE, URDF, edited, good, imported};
use nalgebra::{Isometry3, Matrix3, Point3, Rotation3, Translation3, UnitQuaternion, Vector3};
use rollwalk_robot::Robot;
use rollwalk_robot::urdf::{Text, import, survey};
use std::collections::HashMap;
use std::path::PathBuf;

/// Poses of a robot's links in the root frame.
fn links(robot: &Robot, angles: &[f64]) -> Vec<Isometry3<f64>> {
    let mut links = vec![Isometry3::identity(); robot.links.len()];
    for (joint, angle) in robot.joints.iter().zip(angles) {
        let turn = UnitQuaternion::new(joint.axis_in_joint * *angle);
        links[joint.child] = links[joint.parent]
            * joint.parent_from_joint
            * Isometry3::from_parts(Translation3::identity(), turn);
    }
    links
}

/// Random angles within the limits, from a linear congruential generator.
fn random_angles(robot: &Robot, seed: u64) -> Vec<f64> {
    let mut state = seed;
    let mut next = || {
        state =
            state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 11) as f64 / (1_u64 << 53) as f64
    };
    let range = |j: &rollwalk_robot::Joint| (j.position_min_rad, j.position_max_rad);
    robot.joints.iter().map(range).map(|(min, max)| min + (max - min) * next()).collect()
}

/// Compares mass, first moment and inertia about the root's origin between robot and URDF. Robot files have twelve digits, so
/// that the tolerance of 1e-9 of the largest value is far above rounding.
fn assert_same_masses(
    robot: &Robot,
    poses: &[Isometry3<f64>],
    truth: &Truth,
    turn: &Rotation3<f64>,
) {
    let mut moment = Vector3::zeros();
    let mut inertia = Matrix3::zeros();
    for (link, pose) in robot.links.iter().zip(poses) {
        let c = (pose * Point3::from(link.com_in_link_m)).coords;
        let r = pose.rotation.to_rotation_matrix();
        moment += c * link.mass_kg;
        inertia += r.matrix() * link.inertia_in_link_kg_m2 * r.matrix().transpose()
            + (Matrix3::identity() * c.dot(&c) - c * c.transpose()) * link.mass_kg;
    }
    let mass_kg = robot.total_mass_kg();
    // Each link without mass gets 1e-6 of the robot's mass.
    let spare = 1e-9 + 1.1e-6 * robot.links.len() as f64;
    assert!((mass_kg - truth.mass_kg).abs() < spare * mass_kg, "{mass_kg} {}", truth.mass_kg);
    let expected = turn * truth.moment_kg_m;
    assert!((moment - expected).amax() < spare * mass_kg, "{moment} {expected}");
    let expected = turn.matrix() * truth.inertia_kg_m2 * turn.matrix().transpose();
    assert!((inertia - expected).amax() < spare * expected.amax(), "{inertia} {expected}");
}

#[test]
fn the_rover_is_what_its_urdf_says_at_any_angles() {
    let robot = good(URDF, SIDE).robot;
    let mut exact = robot.clone();
    exact.links.retain(|link| link.mass_kg > 1e-3);
    assert_eq!(exact, robot, "no link without mass");
    for seed in 0..20 {
        let angles = random_angles(&robot, seed);
        let mut positions: HashMap<_, _> = robot
            .joints
            .iter()
            .map(|joint| joint.name.clone())
            .zip(angles.iter().copied())
            .collect();
        positions.extend([("mast".to_owned(), 0.15), ("nod".to_owned(), 0.3)]);
        let truth = truth(URDF, "base_link", &positions);
        let poses = links(&robot, &angles);
        assert_same_masses(&robot, &poses, &truth, &Rotation3::identity());
        let wanted = [
            ("left_foot", [0.01, 0.0, 0.0]),
            ("right_foot", [0.0; 3]),
            ("left_wheel", [0.0; 3]),
            ("right_wheel", [0.0; 3]),
        ];
        for (end, (link, in_link)) in robot.end_effectors.iter().zip(wanted) {
            let center = poses[end.link] * Point3::from(end.center_in_link_m);
            let expected = truth.point(link, in_link);
            assert!((center.coords - expected).amax() < 1e-10, "{link}: {center} {expected}");
            if let Some(axis) = end.contact.axis_in_link() {
                let sign = if link == "left_wheel" { 1.0 } else { -1.0 };
                let far = truth.point(link, [0.0, sign, 0.0]) - expected;
                assert!((poses[end.link].rotation * axis - far).amax() < 1e-10, "{link}");
            }
        }
    }
}

#[test]
fn values_of_urdf_and_side_file_arrive() {
    let robot = good(URDF, SIDE).robot;
    let names: Vec<_> = robot.joints.iter().map(|joint| joint.name.as_str()).collect();
    // Limb by limb with parents first; limbs in the order of the root's joints.
    assert_eq!(names, ["left_arm", "left_hip", "left_knee", "right_hip", "right_knee"]);
    let hip = &robot.joints[3];
    assert_eq!((hip.position_min_rad, hip.position_max_rad, hip.nominal_rad), (-2.0, 0.9, -0.7));
    assert_eq!((hip.actuator.bus, hip.actuator.id), (3, 9));
    assert_eq!((hip.actuator.speed_max_rad_s, hip.actuator.torque_max_nm), (12.0, 20.0));
    assert_eq!(hip.actuator.armature_kg_m2, 0.01);
    // Documented default: 0.3 rad under a quarter of the weight, because two legs and two wheels stand, at the leg's length.
    let length_m = 0.2 + (0.2_f64.powi(2) + 0.01_f64.powi(2)).sqrt();
    let share_n = robot.total_mass_kg() * 9.806_65 / 4.0;
    let kp = share_n * length_m / 0.3;
    let found = hip.actuator.kp_nm_rad;
    assert!(found <= kp && kp < found + 1.0, "{found} is not {kp} rounded down to two digits");
    // Critical for limb and rotor: shank and foot below the knee, which is the lightest joint.
    let knee = &robot.joints[4].actuator;
    let inertia = 0.0008 + 0.2 * 0.1_f64.powi(2) + 0.01;
    let kd = 2.0 * (found * inertia).sqrt();
    assert!((knee.kd_nm_s_rad - kd.min(120.0 * inertia)).abs() < 0.1, "{knee:?} {kd}");
    let actuator = robot.end_effectors[2].contact.actuator().unwrap();
    assert_eq!((actuator.kp_nm_rad, actuator.kd_nm_s_rad, actuator.torque_max_nm), (0.0, 0.5, 5.0));
    assert!(robot.end_effectors[3].contact.freewheels());
}

#[test]
fn forward_and_up_turn_the_body() {
    // The root's +y points forward in the world, its +x up: left is up × forward = root +z.
    let mounted = edited(
        URDF,
        "<link name=\"base_link\"/>",
        "<link name=\"imu\"/><link name=\"base_link\"/><joint name=\"mount\" type=\"fixed\"><parent link=\"imu\"/>\
         <child link=\"base_link\"/><origin rpy=\"1.5707963267948966 0 1.5707963267948966\"/></joint>",
    );
    let side = format!("forward = \"+y\"\nup = \"+x\"\n{SIDE}");
    let robot = good(&mounted, &side).robot;
    let angles = random_angles(&robot, 7);
    let mut positions: HashMap<_, _> =
        robot.joints.iter().map(|joint| joint.name.clone()).zip(angles.iter().copied()).collect();
    positions.extend([("mast".to_owned(), 0.15), ("nod".to_owned(), 0.3)]);
    let truth = truth(&mounted, "imu", &positions);
    let turn =
        Rotation3::from_matrix_unchecked(Matrix3::new(0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 1.0, 0.0, 0.0));
    assert_same_masses(&robot, &links(&robot, &angles), &truth, &turn);
    // Legs along the robot's own x axis are not legs: the same message for a root with usual axes.
    let error = imported(URDF, &side).unwrap_err().to_string();
    assert!(
        error.contains("`front_left`") && error.contains("above the centre of mass"),
        "{error}"
    );
}

/// Tests every URDF in the folder `ROLLWALK_URDF_DIR`: imports it with the side file that the survey proposes, and compares the
/// result.
#[test]
fn urdfs_of_a_folder_are_what_they_say() {
    let Some(folder) = std::env::var_os("ROLLWALK_URDF_DIR").map(PathBuf::from) else { return };
    let mut count = 0;
    for entry in std::fs::read_dir(&folder).unwrap() {
        let path = entry.unwrap().path();
        if path.extension().is_none_or(|extension| extension != "urdf") {
            continue;
        }
        count += 1;
        let name = path.to_string_lossy();
        let text = std::fs::read_to_string(&path).unwrap();
        let urdf = Text { name: &name, text: &text };
        let found = survey(urdf).unwrap_or_else(|error| panic!("{name}: {error}"));
        let made = import(urdf, Text { name: "template", text: &found.template });
        let robot =
            made.unwrap_or_else(|error| panic!("{name}: {error}\n{}", found.template)).robot;
        for seed in 0..5 {
            let angles = random_angles(&robot, seed);
            let positions: HashMap<_, _> = robot
                .joints
                .iter()
                .map(|joint| joint.name.clone())
                .zip(angles.iter().copied())
                .collect();
            let truth = truth(&text, &found.root, &positions);
            let poses = links(&robot, &angles);
            assert_same_masses(&robot, &poses, &truth, &Rotation3::identity());
        }
    }
    assert!(count > 0, "{} has no .urdf files", folder.display());
}
