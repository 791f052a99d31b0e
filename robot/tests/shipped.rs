//! The robot files that ship with the project are valid, and mean what their comments say.

use nalgebra::{Isometry3, Point3, Translation3, UnitQuaternion, Vector3};
use rollwalk_robot::Robot;

fn shipped(name: &str, text: &str) -> Robot {
    Robot::from_toml(name, text).unwrap_or_else(|error| {
        panic!("{error}\n{:?}", miette::Report::new(error.clone()));
    })
}

fn agilebot() -> Robot {
    shipped("robots/agilebot.toml", include_str!("../../robots/agilebot.toml"))
}

/// `body_from_link` of every link at the nominal pose: chain of joint frames, written out here
/// independently of the planner's kinematics.
fn nominal_links(robot: &Robot) -> Vec<Isometry3<f64>> {
    let mut links = vec![Isometry3::identity(); robot.links.len()];
    for joint in &robot.joints {
        let turn = UnitQuaternion::new(joint.axis_in_joint * joint.nominal_rad);
        links[joint.child] = links[joint.parent]
            * joint.parent_from_joint
            * Isometry3::from_parts(Translation3::identity(), turn);
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

/// Lowest points of the end effectors in the body frame, with the body level.
fn contacts_in_body(robot: &Robot) -> Vec<Vector3<f64>> {
    let links = nominal_links(robot);
    let contact = |foot: &rollwalk_robot::EndEffector| {
        let center = links[foot.link] * Point3::from(foot.center_in_link_m);
        center.coords - Vector3::z() * foot.radius_m
    };
    robot.end_effectors.iter().map(contact).collect()
}

#[test]
fn agilebot_has_the_counts_of_table_2_1_and_a_plausible_mass() {
    let robot = agilebot();
    assert_eq!(robot.joints.len(), 16);
    assert_eq!(robot.end_effectors.len(), 4);
    assert_eq!(robot.channels().count(), 20);
    let mass = robot.total_mass_kg();
    // 8 XM540 and 12 XM430 alone are 2.304 kg.
    assert!((4.0..5.0).contains(&mass), "{mass} kg");
}

#[test]
fn agilebot_stands_level_with_lateral_wheels_and_its_com_between_them() {
    let robot = agilebot();
    let links = nominal_links(&robot);
    let contacts = contacts_in_body(&robot);
    for contact in &contacts {
        // Sums of a few rounded lengths below 1 m.
        assert!((contact.z - contacts[0].z).abs() < 1e-12, "{contact}");
    }
    for wheel in &robot.end_effectors {
        let axis = links[wheel.link] * wheel.contact.wheel_axis_in_link().unwrap();
        assert!((axis - Vector3::y()).amax() < 1e-12, "{}: {axis}", wheel.name);
    }
    for joint in robot.joints.iter().filter(|joint| joint.name.ends_with("_steer")) {
        let axis = links[joint.child] * joint.axis_in_joint;
        assert!((axis.z.abs() - 1.0).abs() < 1e-12, "{}: {axis}", joint.name);
    }
    let center = contacts.iter().sum::<Vector3<f64>>() / 4.0;
    let com = com_in_body(&robot);
    // Half a centimetre of a 0.32 m wheel base: all four wheels carry about the same.
    assert!((com.x - center.x).abs() < 0.005, "com at {com}, wheels at {center}");
    assert!((com.y - center.y).abs() < 1e-12, "com at {com}, wheels at {center}");
}
