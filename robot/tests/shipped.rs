//! Tests that the shipped robot files are valid and agree with their comments.

use nalgebra::{Isometry3, Matrix3, Point3, Translation3, UnitQuaternion, Vector3};
use rollwalk_protocol::config::ChannelKind;
use rollwalk_robot::Robot;

fn shipped(name: &str, text: &str) -> Robot {
    Robot::from_toml(name, text).unwrap_or_else(|error| {
        panic!("{error}\n{:?}", miette::Report::new(error.clone()));
    })
}

fn agilebot() -> Robot {
    shipped("robots/agilebot.toml", include_str!("../../shipped/robots/agilebot.toml"))
}

/// Pose `body_from_link` of each link in the nominal pose, computed independently of the planner's kinematics.
fn nominal_links(robot: &Robot) -> Vec<Isometry3<f64>> {
    let mut links = vec![Isometry3::identity(); robot.links.len()];
    for joint in &robot.joints {
        let moved = match joint.travel_m_per_rad {
            Some(travel) => {
                Translation3::from(joint.axis_in_joint * (travel * joint.nominal_rad)).into()
            }
            None => Isometry3::from_parts(
                Translation3::identity(),
                UnitQuaternion::new(joint.axis_in_joint * joint.nominal_rad),
            ),
        };
        links[joint.child] = links[joint.parent] * joint.parent_from_joint * moved;
    }
    links
}

fn com_in_body(robot: &Robot) -> Vector3<f64> {
    let links = nominal_links(robot);
    let moment: Vector3<f64> = robot
        .links
        .iter()
        .zip(&links)
        .map(|(link, pose)| (pose * Point3::from(link.com_in_link_m)).coords * link.mass_kg)
        .sum();
    moment / robot.total_mass_kg()
}

/// Lowest points of the end effectors in the body frame, with a level body.
fn contacts_in_body(robot: &Robot) -> Vec<Vector3<f64>> {
    let links = nominal_links(robot);
    let contact = |foot: &rollwalk_robot::EndEffector| {
        let center = links[foot.link] * Point3::from(foot.center_in_link_m);
        center.coords - Vector3::z() * foot.radius_m
    };
    robot.end_effectors.iter().map(contact).collect()
}

/// Shipped robots, each with its numbers of joints, end effectors and channels, and the range of its mass, kg.
fn all() -> Vec<(Robot, [usize; 3], std::ops::Range<f64>)> {
    macro_rules! shipped {
        ($($name:literal: $counts:expr, $mass:expr;)*) => {
            vec![$((
                shipped(
                    concat!("robots/", $name, ".toml"),
                    include_str!(concat!("../../shipped/robots/", $name, ".toml")),
                ),
                $counts,
                $mass,
            )),*]
        };
    }
    // Servos alone are 2.304 kg in AgileBot, 1.974 kg in SwizzleBot and 0.198 kg in Creature3.
    shipped! {
        "agilebot": [16, 4, 20], 4.0..5.0;
        "agilebot_sprint": [16, 4, 20], 4.0..5.0;
        "anymal_wheels": [12, 4, 16], 35.0..38.0;
        "brainbot": [9, 3, 9], 2.0..3.0;
        "car": [0, 4, 4], 1.5..2.0;
        "car_tilted": [0, 4, 4], 1.5..2.0;
        "creature3": [9, 4, 9], 0.35..0.55;
        "dinobot": [17, 8, 17], 4.0..5.0;
        "legbot": [16, 4, 16], 4.0..5.0;
        "pup": [8, 4, 12], 0.6..0.7;
        "pup_belt": [8, 4, 12], 0.6..0.7;
        "pup_five_bar": [8, 4, 12], 0.6..0.7;
        "pup_linear": [8, 4, 8], 0.5..0.6;
        "pup_toes": [12, 4, 8], 0.5..0.6;
        "skatebot": [16, 8, 16], 0.4..0.7;
        "skaterbot": [16, 8, 16], 4.0..5.0;
        "swizzlebot": [12, 4, 12], 3.0..4.0;
        "swizzlebot2": [8, 4, 8], 2.0..3.0;
        "swizzlebot4": [16, 4, 16], 3.5..4.5;
        "swizzlebot5": [20, 4, 20], 4.0..5.0;
        "test_leg": [2, 1, 3], 2.5..3.5;
    }
}

#[test]
fn robots_have_the_counts_of_table_2_1_and_plausible_masses() {
    for (robot, [joints, end_effectors, channels], mass) in all() {
        assert_eq!(robot.joints.len(), joints, "{}", robot.name);
        assert_eq!(robot.end_effectors.len(), end_effectors, "{}", robot.name);
        assert_eq!(robot.channels().count(), channels, "{}", robot.name);
        assert!(mass.contains(&robot.total_mass_kg()), "{} kg", robot.total_mass_kg());
    }
}

#[test]
fn every_robot_file_is_looked_at() {
    let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/../shipped/robots");
    let mut files: Vec<_> = std::fs::read_dir(folder)
        .unwrap()
        .map(|entry| entry.unwrap().path().file_stem().unwrap().to_string_lossy().into_owned())
        .collect();
    files.sort_unstable();
    let names: Vec<_> = all().into_iter().map(|(robot, ..)| robot.name).collect();
    assert_eq!(names, files);
}

#[test]
fn robots_stand_level_on_lateral_wheels_with_the_com_between_them() {
    // The tilted wheels of car_tilted hang above the ground, which is its purpose.
    for (robot, ..) in all().into_iter().filter(|(robot, ..)| robot.name != "car_tilted") {
        let links = nominal_links(&robot);
        let contacts = contacts_in_body(&robot);
        for contact in &contacts {
            // Sums of a few rounded lengths below 1 m.
            assert!((contact.z - contacts[0].z).abs() < 1e-12, "{}: {contact}", robot.name);
        }
        for wheel in &robot.end_effectors {
            let Some(axis) = wheel.contact.axis_in_link() else { continue };
            let axis = links[wheel.link] * axis;
            assert!((axis - Vector3::y()).amax() < 1e-12, "{}: {axis}", wheel.name);
        }
        for joint in robot.joints.iter().filter(|joint| joint.name.ends_with("_steer")) {
            let axis = links[joint.child] * joint.axis_in_joint;
            assert!((axis.z.abs() - 1.0).abs() < 1e-12, "{}: {axis}", joint.name);
        }
        let center = contacts.iter().sum::<Vector3<f64>>() / contacts.len() as f64;
        let com = com_in_body(&robot);
        // About 5 % of the wheel base: all feet carry about the same.
        assert!((com.x - center.x).abs() < 0.008, "com at {com}, feet at {center}");
        // ANYmal's body is not quite symmetric, and Brainbot's rear leg stands beside its hip.
        let lateral = match robot.name.as_str() {
            "anymal_wheels" | "brainbot" => 0.01,
            _ => 1e-12,
        };
        assert!((com.y - center.y).abs() < lateral, "com at {com}, feet at {center}");
    }
}

/// Tests that the right side of each robot is the mirror image of the left side: poses, masses and limits.
#[test]
fn left_and_right_limbs_are_mirror_images() {
    for (robot, ..) in all() {
        let links = nominal_links(&robot);
        let mirror = Matrix3::from_diagonal(&Vector3::new(1.0, -1.0, 1.0));
        for (index, right) in robot.links.iter().enumerate() {
            let Some((end, _)) = right.name.split_once("_right") else { continue };
            let left_name = format!("{end}_left{}", &right.name[end.len() + 6..]);
            let other = robot.links.iter().position(|link| link.name == left_name).unwrap();
            let left = &robot.links[other];
            assert_eq!(left.mass_kg, right.mass_kg);
            let in_body = |pose: &Isometry3<f64>, link: &rollwalk_robot::Link| {
                let turn = pose.rotation.to_rotation_matrix();
                let com = (pose * Point3::from(link.com_in_link_m)).coords;
                (com, turn * link.inertia_in_link_kg_m2 * turn.transpose())
            };
            let (right_com, right_inertia) = in_body(&links[index], right);
            let (left_com, left_inertia) = in_body(&links[other], left);
            // Rounding only; inertias are around 1e-4 kg·m².
            assert!((mirror * right_com - left_com).amax() < 1e-12, "{}", right.name);
            assert!((mirror * right_inertia * mirror - left_inertia).amax() < 1e-16);
        }
        for right in robot.joints.iter().filter(|joint| joint.name.contains("_right_")) {
            let name = right.name.replace("_right_", "_left_");
            let left = robot.joints.iter().find(|joint| joint.name == name).unwrap();
            assert_eq!(left.position_min_rad, right.position_min_rad);
            assert_eq!(left.position_max_rad, right.position_max_rad);
            assert_eq!(left.nominal_rad, right.nominal_rad);
        }
    }
}

#[test]
fn robots_survive_json_bit_by_bit() {
    for (robot, ..) in all() {
        let json = serde_json::to_string(&robot).unwrap();
        let read: Robot = serde_json::from_str(&json).unwrap();
        assert_eq!(read, robot);
        read.validate().unwrap();
        read.controller_config().unwrap().check().unwrap();
    }
}

/// Tests that robots have different configuration hashes. LegBot and SkaterBot have equal actuators, limits, gains and
/// addresses, but cannot play each other's motions.
#[test]
fn no_two_robots_take_each_others_libraries() {
    let mut seen = std::collections::BTreeMap::new();
    for (robot, ..) in all() {
        let hash = robot.controller_config().unwrap().hash();
        if let Some(other) = seen.insert(hash, robot.name.clone()) {
            panic!("{} and {other} have the configuration hash {hash:#010x}", robot.name);
        }
    }
    let [legbot, skaterbot] = ["legbot", "skaterbot"].map(|name| {
        let robot = all().into_iter().map(|(robot, ..)| robot).find(|robot| robot.name == name);
        robot.unwrap().controller_config().unwrap().channels
    });
    assert_eq!(legbot, skaterbot, "two robots that only their names tell apart");
}

#[test]
fn the_controller_gets_joints_first_then_wheels_with_addresses_on_two_buses() {
    let robot = agilebot();
    let config = robot.controller_config().unwrap();
    assert_eq!(config.channels.len(), 20);
    let names: Vec<_> = robot.channels().map(|channel| channel.name().to_owned()).collect();
    assert_eq!(names[0], "front_left_hip_roll");
    assert_eq!(names[15], "rear_right_steer");
    assert_eq!(names[16..], ["front_left", "front_right", "rear_left", "rear_right"]);

    let (joints, wheels) = config.channels.split_at(16);
    assert!(joints.iter().all(|channel| channel.kind == ChannelKind::JointPosition));
    assert!(wheels.iter().all(|channel| channel.kind == ChannelKind::WheelSpeed));
    assert_eq!((joints[2].min, joints[2].max, joints[2].max_rate), (-2.2, -0.2, 4.16));
    assert_eq!((wheels[0].min, wheels[0].max, wheels[0].kp_nm_rad), (-6.85, 6.85, 0.0));
    // μ g / r = 0.8 · 9.80665 / 0.05, below torque / armature = 400.
    assert!((wheels[0].max_rate - 156.906_4).abs() < 1e-3, "{}", wheels[0].max_rate);

    let mut addresses: Vec<_> =
        config.channels.iter().map(|channel| (channel.bus, channel.id)).collect();
    addresses.sort_unstable();
    let expected: Vec<_> = (0..2).flat_map(|bus| (1..=10).map(move |id| (bus, id))).collect();
    assert_eq!(addresses, expected);
    assert_eq!((wheels[0].bus, wheels[0].id, wheels[3].bus, wheels[3].id), (0, 5, 1, 10));
}
