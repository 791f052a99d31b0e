//! What is exported as URDF comes back by the project's own import.

use rollwalk_robot::Robot;
use rollwalk_robot::urdf::{Text, import, survey};
use std::path::Path;

fn shipped(name: &str) -> Robot {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join(format!("../robots/{name}.toml"));
    Robot::from_toml(name, &std::fs::read_to_string(path).unwrap()).unwrap()
}

#[test]
fn robots_come_back_from_urdf_with_their_joints_wheels_and_masses() {
    for name in ["agilebot", "pup", "anymal_wheels", "swizzlebot", "creature3"] {
        let robot = shipped(name);
        let text = rollwalk_interchange::urdf(&robot, &[]).unwrap();
        let urdf = Text { name, text: &text };
        let side = survey(urdf).unwrap().template;
        let back = import(urdf, Text { name: "side", text: &side }).unwrap().robot;
        assert!((back.total_mass_kg() - robot.total_mass_kg()).abs() < 1e-9, "{name}");
        assert_eq!(back.joints.len(), robot.joints.len(), "{name}");
        for joint in &robot.joints {
            let found = back.joints.iter().find(|other| other.name == joint.name);
            let found = found.unwrap_or_else(|| panic!("{name} has no {}", joint.name));
            assert_eq!(found.position_min_rad, joint.position_min_rad, "{name} {}", joint.name);
            assert_eq!(found.position_max_rad, joint.position_max_rad, "{name} {}", joint.name);
            let (there, here) = (&found.actuator, &joint.actuator);
            assert_eq!(there.torque_max_nm, here.torque_max_nm, "{name} {}", joint.name);
            assert_eq!(there.speed_max_rad_s, here.speed_max_rad_s, "{name} {}", joint.name);
        }
        let wheels = |robot: &Robot| {
            let spins = robot.end_effectors.iter().filter(|foot| foot.contact.spins());
            let mut places: Vec<_> = spins.map(|foot| foot.radius_m).collect();
            places.sort_by(f64::total_cmp);
            places
        };
        assert_eq!(wheels(&back), wheels(&robot), "{name}");
    }
}

#[test]
fn a_link_and_a_wheel_of_one_name_are_two_bodies() {
    let mut robot = shipped("agilebot");
    robot.end_effectors[0].name.clone_from(&robot.links[1].name);
    let text = rollwalk_interchange::mjcf(&robot, &[]).unwrap();
    let name = &robot.links[1].name;
    assert_eq!(text.matches(&format!("<body name=\"{name}\"")).count(), 1);
    assert_eq!(text.matches(&format!("<body name=\"{name}_wheel\"")).count(), 1);
}

#[test]
fn robots_come_back_from_mjcf_with_their_joints_wheels_and_masses() {
    for name in ["agilebot", "pup", "anymal_wheels", "legbot"] {
        let robot = shipped(name);
        let text = rollwalk_interchange::mjcf(&robot, &[]).unwrap();
        let model = Text { name, text: &text };
        let side = survey(model).unwrap().template;
        let back = import(model, Text { name: "side", text: &side }).unwrap().robot;
        assert!((back.total_mass_kg() - robot.total_mass_kg()).abs() < 1e-9, "{name}");
        assert_eq!(back.joints.len(), robot.joints.len(), "{name}");
        for joint in &robot.joints {
            let found = back.joints.iter().find(|other| other.name == joint.name);
            let found = found.unwrap_or_else(|| panic!("{name} has no {}", joint.name));
            let near = |a: f64, b: f64| assert!((a - b).abs() < 1e-9, "{name} {}", joint.name);
            near(found.position_min_rad, joint.position_min_rad);
            near(found.position_max_rad, joint.position_max_rad);
            near(found.actuator.torque_max_nm, joint.actuator.torque_max_nm);
        }
    }
}
