//! Round trip: the project's own import reads the exported URDF.

use rollwalk_interchange::foxglove::{Figure, Posture};
use rollwalk_robot::urdf::{Text, import, survey};
use rollwalk_robot::{EndEffector, Joint, JointSpring, Robot};
use std::collections::{BTreeMap, HashSet};
use std::path::Path;

fn shipped(name: &str) -> Robot {
    let path =
        Path::new(env!("CARGO_MANIFEST_DIR")).join(format!("../../shipped/robots/{name}.toml"));
    Robot::from_toml(name, &std::fs::read_to_string(path).unwrap()).unwrap()
}

/// Returns a shipped robot after export and import with the side file that the survey proposes, and the original robot. Mass,
/// joints, limits and torques must agree to rounding.
fn round_trip(name: &str, exported: impl Fn(&Robot) -> String) -> [Robot; 2] {
    let robot = shipped(name);
    let text = exported(&robot);
    let text = Text { name, text: &text };
    let side = survey(text).unwrap().template;
    let back = import(text, Text { name: "side", text: &side }).unwrap().robot;
    assert!((back.total_mass_kg() - robot.total_mass_kg()).abs() < 1e-9, "{name}");
    assert_eq!(back.joints.len(), robot.joints.len(), "{name}");
    for joint in &robot.joints {
        let found = joint_named(&back, &joint.name);
        let near = |a: f64, b: f64| assert!((a - b).abs() < 1e-9, "{name} {}", joint.name);
        near(found.position_min_rad, joint.position_min_rad);
        near(found.position_max_rad, joint.position_max_rad);
        near(found.actuator.torque_max_nm, joint.actuator.torque_max_nm);
    }
    [robot, back]
}

fn joint_named<'r>(robot: &'r Robot, name: &str) -> &'r Joint {
    let found = robot.joints.iter().find(|joint| joint.name == name);
    found.unwrap_or_else(|| panic!("{} has no {name}", robot.name))
}

#[test]
fn robots_come_back_from_urdf_with_their_joints_wheels_and_masses() {
    for name in ["agilebot", "pup", "anymal_wheels", "swizzlebot", "creature3"] {
        let [robot, back] =
            round_trip(name, |robot| rollwalk_interchange::urdf(robot, &[]).unwrap());
        for joint in &robot.joints {
            let found = joint_named(&back, &joint.name);
            let range = |joint: &Joint| [joint.position_min_rad, joint.position_max_rad];
            assert_eq!(range(found), range(joint), "{name} {}", joint.name);
            let motor =
                |joint: &Joint| [joint.actuator.torque_max_nm, joint.actuator.speed_max_rad_s];
            assert_eq!(motor(found), motor(joint), "{name} {}", joint.name);
        }
        assert_eq!(wheels(&back), wheels(&robot), "{name}");
    }
}

#[test]
fn robots_come_back_from_mjcf_with_their_joints_wheels_and_masses() {
    for name in ["agilebot", "pup", "pup_belt", "anymal_wheels", "legbot"] {
        let [robot, back] =
            round_trip(name, |robot| rollwalk_interchange::mjcf(robot, &[]).unwrap());
        for joint in &robot.joints {
            let armature = |joint: &Joint| joint.actuator.armature_kg_m2;
            assert_eq!(
                armature(joint_named(&back, &joint.name)),
                armature(joint),
                "{name} {}",
                joint.name
            );
            let [ratios, found] = [(&robot, joint), (&back, joint_named(&back, &joint.name))]
                .map(|(robot, joint)| ratios(robot, joint));
            assert_eq!(found, ratios, "{name} {}", joint.name);
        }
        assert_eq!(wheels(&back).len(), wheels(&robot).len(), "{name}");
    }
}

#[test]
fn springs_come_back_from_mjcf_and_dampers_from_urdf() {
    let mut robot = shipped("pup");
    for (number, joint) in robot.joints.iter_mut().enumerate() {
        let damping_nm_s_rad = if number % 3 == 2 { 0.0 } else { 0.02 };
        joint.spring = (number % 3 != 0).then_some(JointSpring {
            stiffness_nm_rad: 0.8,
            rest_rad: -1.9,
            damping_nm_s_rad,
        });
    }
    let back = |text: &str| {
        let text = Text { name: "pup", text };
        let side = survey(text).unwrap().template;
        import(text, Text { name: "side", text: &side }).unwrap().robot
    };
    let [mjcf, urdf] = [
        back(&rollwalk_interchange::mjcf(&robot, &[]).unwrap()),
        back(&rollwalk_interchange::urdf(&robot, &[]).unwrap()),
    ];
    for joint in &robot.joints {
        assert_eq!(joint_named(&mjcf, &joint.name).spring, joint.spring, "{}", joint.name);
        let damping = joint.spring.map(|of| of.damping_nm_s_rad).filter(|of| *of > 0.0);
        let found = joint_named(&urdf, &joint.name).spring.map(|of| of.damping_nm_s_rad);
        assert_eq!(found, damping, "{}", joint.name);
    }
}

#[test]
fn passive_joints_come_back_from_mjcf_without_motors() {
    let robot = shipped("pup_toes");
    let text = rollwalk_interchange::mjcf(&robot, &[]).unwrap();
    assert_eq!(text.matches("<position ").count(), 8);
    assert_eq!(text.matches("stiffness=").count(), 4);
    let text = Text { name: "pup_toes", text: &text };
    let side = survey(text).unwrap().template;
    let back = import(text, Text { name: "side", text: &side }).unwrap().robot;
    assert_eq!(back.channels().count(), 8);
    for joint in &robot.joints {
        let other = joint_named(&back, &joint.name);
        assert_eq!((other.is_passive(), other.spring), (joint.is_passive(), joint.spring));
        // The template takes the rest angle of a spring, whose load it does not know.
        let rest_rad = joint.spring.map_or(other.nominal_rad, |spring| spring.rest_rad);
        assert!((other.nominal_rad - rest_rad).abs() < 1e-3, "{}", joint.name);
    }
}

#[test]
fn joints_that_slide_come_back_in_metres_and_newtons() {
    let robot = shipped("pup_linear");
    for (text, has_armature) in [
        (rollwalk_interchange::urdf(&robot, &[]).unwrap(), false),
        (rollwalk_interchange::mjcf(&robot, &[]).unwrap(), true),
    ] {
        let text = Text { name: "pup_linear", text: &text };
        let side = survey(text).unwrap().template;
        let travel = "nominal_m = 0.025";
        assert_eq!(side.matches(travel).count(), 4, "{side}");
        let side = side.replace(travel, &format!("{travel}, travel_m_per_rad = 0.018"));
        let back = import(text, Text { name: "side", text: &side });
        let back = back.unwrap_or_else(|error| panic!("{error}\n{side}")).robot;
        assert!((back.total_mass_kg() - robot.total_mass_kg()).abs() < 1e-9);
        for joint in &robot.joints {
            let other = joint_named(&back, &joint.name);
            assert_eq!(other.travel_m_per_rad, joint.travel_m_per_rad, "{}", joint.name);
            let values = |of: &Joint| {
                let armature = if has_armature { of.actuator.armature_kg_m2 } else { 0.0 };
                let limits = [of.position_min_rad, of.position_max_rad, armature];
                let speed = if has_armature { 0.0 } else { of.actuator.speed_max_rad_s };
                [limits, [of.actuator.torque_max_nm, speed, of.nominal_rad]].concat()
            };
            for (found, expected) in values(other).iter().zip(values(joint)) {
                assert!((found - expected).abs() < 1e-6, "{}: {found} {expected}", joint.name);
            }
        }
    }
}

#[test]
fn cranks_and_rods_come_back_from_mjcf() {
    let robot = shipped("pup_five_bar");
    let text = rollwalk_interchange::mjcf(&robot, &[]).unwrap();
    let text = Text { name: "pup_five_bar", text: &text };
    let side = survey(text).unwrap().template;
    let back = import(text, Text { name: "side", text: &side });
    let back = back.unwrap_or_else(|error| panic!("{error}\n{side}")).robot;
    assert!((back.total_mass_kg() - robot.total_mass_kg()).abs() < 1e-9);
    assert_eq!(back.joints.len(), robot.joints.len());
    let motors = |of: &Robot, degrees: [f64; 2]| {
        let angle =
            |joint: &Joint| degrees[usize::from(joint.name.ends_with("_knee"))].to_radians();
        let angles: Vec<_> = of.joints.iter().map(angle).collect();
        of.transmission().motors(&angles)
    };
    for joint in &robot.joints {
        let turned = |of: &Robot| {
            let index = of.joints.iter().position(|other| other.name == joint.name).unwrap();
            let [from, to] = [[34.0, -69.0], [46.0, -80.0]].map(|pose| motors(of, pose)[index]);
            to - from
        };
        let (found, expected) = (turned(&back), turned(&robot));
        assert!((found - expected).abs() < 1e-6, "{}: {found} {expected}", joint.name);
    }
}

/// Ratios of a coupled motor by the names of joints.
fn ratios<'r>(robot: &'r Robot, joint: &Joint) -> BTreeMap<&'r str, String> {
    let ratios = joint.motor_per_joint.iter();
    ratios.map(|of| (&*robot.joints[of.joint].name, of.ratio.to_string())).collect()
}

#[test]
fn wheels_without_motors_come_back_without_motors() {
    for name in ["swizzlebot", "dinobot"] {
        let urdf = |robot: &Robot| rollwalk_interchange::urdf(robot, &[]).unwrap();
        let mjcf = |robot: &Robot| rollwalk_interchange::mjcf(robot, &[]).unwrap();
        for [robot, back] in [round_trip(name, urdf), round_trip(name, mjcf)] {
            let kinds = |robot: &Robot| {
                let feet = robot.end_effectors.iter();
                let kind =
                    |foot: &EndEffector| (foot.contact.spins(), foot.contact.actuator().is_some());
                let mut kinds: Vec<_> = feet.map(kind).collect();
                kinds.sort();
                kinds
            };
            assert_eq!(kinds(&back), kinds(&robot), "{name}");
        }
    }
}

/// Radii of all spinning wheels in order of size, m.
fn wheels(robot: &Robot) -> Vec<f64> {
    let spins = robot.end_effectors.iter().filter(|foot| foot.contact.spins());
    let mut radii: Vec<_> = spins.map(|foot| foot.radius_m).collect();
    radii.sort_by(f64::total_cmp);
    radii
}

#[test]
fn names_that_a_format_takes_for_itself_are_given_once() {
    let mut robot = shipped("legbot");
    robot.joints[0].name = "base".to_owned();
    robot.links[1].name = "world".to_owned();
    robot.end_effectors[0].name = "ground".to_owned();
    robot.joints[1].name = format!("{}_mount", robot.end_effectors[1].name);
    let names = |text: &str, elements: &[&str]| {
        let document = roxmltree::Document::parse(text).unwrap();
        let all = document.descendants().filter(|node| elements.contains(&node.tag_name().name()));
        let mut names: Vec<_> =
            all.filter_map(|node| Some(node.attribute("name")?.to_owned())).collect();
        names.sort();
        names
    };
    let unique = |names: &[String]| assert!(names.windows(2).all(|two| two[0] != two[1]));
    let model = rollwalk_interchange::mjcf(&robot, &[]).unwrap();
    let bodies = names(&model, &["body"]);
    unique(&bodies);
    assert!(bodies.iter().any(|name| name == "world_link") && !bodies.contains(&"world".into()));
    let joints = names(&model, &["joint", "freejoint"]);
    unique(&joints);
    assert!(joints.contains(&"base_joint".into()), "{joints:?}");
    let geoms = names(&model, &["geom"]);
    unique(&geoms);
    assert!(geoms.contains(&"ground_foot".into()), "{geoms:?}");
    let urdf = rollwalk_interchange::urdf(&robot, &[]).unwrap();
    unique(&names(&urdf, &["joint"]));
    unique(&names(&urdf, &["link"]));
}

#[test]
fn a_joint_and_a_wheel_of_one_name_are_two_joint_states() {
    let mut robot = shipped("agilebot");
    robot.joints[0].name.clone_from(&robot.end_effectors[0].name);
    let figure = Figure::new(&robot, &[], "", [1.0; 4]);
    let (joint_rad, wheel_rad) = (vec![0.1; robot.joints.len()], vec![0.2; 4]);
    let posture = Posture {
        world_from_body: nalgebra::Isometry3::identity(),
        joint_rad: &joint_rad,
        wheel_rad: &wheel_rad,
    };
    let states = figure.joint_states(&posture, &[], &[], 0.0).joints;
    let names: HashSet<_> = states.iter().map(|state| &state.name).collect();
    assert_eq!(names.len(), robot.joints.len() + 4);
    let angles: Vec<_> = states.iter().filter_map(|state| state.position).collect();
    assert_eq!(angles, [joint_rad, wheel_rad].concat());
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
