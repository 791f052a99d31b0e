//! `ros2_control` of every shipped robot: each motor has an interface, in the order of channels and with the names of the URDF.

use rollwalk_interchange::{MOCK, controllers, joint_names, urdf, urdf_with_control};
use rollwalk_robot::{Robot, Solid};
use roxmltree::{Document, Node};
use std::path::Path;

fn robots() -> Vec<(Robot, Vec<Vec<Solid>>)> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../shipped/robots");
    let files = std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path());
    let files = files.filter(|file| file.extension().is_some_and(|ending| ending == "toml"));
    let read = |file: &Path| {
        let text = std::fs::read_to_string(file).unwrap();
        Robot::with_parts_from_toml(&file.display().to_string(), &text).unwrap()
    };
    let robots: Vec<_> = files.map(|file| read(&file)).collect();
    assert!(robots.len() >= 15);
    robots
}

fn named<'a>(parent: Node<'a, 'a>, tag: &str) -> Vec<(Node<'a, 'a>, String)> {
    let all = parent.children().filter(|child| child.has_tag_name(tag));
    all.map(|child| (child, child.attribute("name").unwrap_or_default().to_owned())).collect()
}

#[test]
fn every_motor_has_an_interface_with_the_limits_of_the_urdf() {
    for (robot, parts) in robots() {
        let text = urdf_with_control(&robot, &parts, MOCK).unwrap();
        let document = Document::parse(&text).unwrap();
        let root = document.root_element();
        let joints = named(root, "joint");
        let system = named(root, "ros2_control");
        assert_eq!(system.len(), 1, "{}", robot.name);
        let controlled = named(system[0].0, "joint");
        let names: Vec<_> = controlled.iter().map(|(_, name)| name.clone()).collect();
        let channels: Vec<_> = robot.channels().map(|channel| channel.name().to_owned()).collect();
        assert_eq!(names, channels, "{}", robot.name);
        assert_eq!(joint_names(&robot), channels, "{}", robot.name);
        for (of, name) in &controlled {
            let (joint, _) = joints.iter().find(|(_, known)| known == name).unwrap();
            let limit = named(*joint, "limit")[0].0;
            let limit = |key: &str| limit.attribute(key).unwrap().parse::<f64>().unwrap();
            let (kind, expected) = match joint.attribute("type").unwrap() {
                "revolute" | "prismatic" => ("position", [limit("lower"), limit("upper")]),
                _ => ("velocity", [-limit("velocity"), limit("velocity")]),
            };
            let command = &named(*of, "command_interface")[0];
            assert_eq!(command.1, kind, "{name}");
            let params = named(command.0, "param");
            let value = |(param, _): &(Node<'_, '_>, String)| param.text().unwrap().parse::<f64>();
            let values: Vec<_> = params.iter().map(|param| value(param).unwrap()).collect();
            assert_eq!(values, expected, "{name}");
            let states: Vec<_> =
                named(*of, "state_interface").into_iter().map(|(_, name)| name).collect();
            assert_eq!(states, ["position", "velocity", "effort"], "{name}");
        }
    }
}

#[test]
fn a_section_for_other_hardware_names_its_plugin_and_changes_nothing_else() {
    let (robot, parts) = robots().swap_remove(0);
    let plain = urdf(&robot, &parts).unwrap();
    let text = urdf_with_control(&robot, &parts, "my_package/MyRobot").unwrap();
    assert!(text.starts_with(plain.strip_suffix("</robot>\n").unwrap()), "{text}");
    assert!(text.contains("<plugin>my_package/MyRobot</plugin>\n    </hardware>"), "{text}");
}

#[test]
fn controllers_have_the_joints_and_wheels_that_there_are() {
    for (robot, _) in robots() {
        let text = controllers(&robot);
        let count = |words: &str| text.matches(words).count();
        let joints = usize::from(!robot.joints.is_empty());
        let wheels = usize::from(robot.channels().count() > robot.joints.len());
        assert_eq!(count("joint_trajectory_controller:"), 2 * joints, "{text}");
        assert_eq!(count("wheel_velocity_controller:"), 2 * wheels, "{text}");
        assert_eq!(count("      - \""), robot.channels().count(), "{text}");
    }
}
