//! Robots and random states for all tests.

use nalgebra::{Matrix3, Rotation3, UnitQuaternion, Vector3};
use rollwalk_multibody::{Configuration, Tree};
use rollwalk_robot::shape::DEFAULT_CLEARANCE_MARGIN_M;
use rollwalk_robot::{Contact, EndEffector, JointSpring, Robot};
use std::fs;
use std::path::Path;

/// Shipped robots without springs, sorted by file name. [`sprung`] adds springs.
pub fn shipped() -> Vec<Robot> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../shipped/robots");
    let mut paths: Vec<_> =
        fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path()).collect();
    paths.retain(|path| path.extension().is_some_and(|extension| extension == "toml"));
    paths.sort();
    assert!(paths.len() >= 16, "{paths:?}");
    let robot = |path: &std::path::PathBuf| {
        let name = path.file_name().unwrap().to_str().unwrap();
        let text = fs::read_to_string(path).unwrap();
        let mut robot = Robot::from_toml(name, &text).expect("shipped robots are valid");
        robot.joints.iter_mut().for_each(|joint| joint.spring = None);
        robot
    };
    paths.iter().map(robot).collect()
}

/// Shipped robots, SwizzleBot on skates and AgileBot with joints that slide, which no shipped robot has.
pub fn all() -> Vec<Robot> {
    let mut robots = shipped();
    let mut skater = robots.iter().find(|robot| robot.name == "swizzlebot").unwrap().clone();
    skater.name += "_skates";
    for ee in &mut skater.end_effectors {
        let Contact::PassiveWheel { axis_in_link, drag } = ee.contact else {
            panic!("{}", ee.name)
        };
        ee.center_in_link_m.z += 0.5 - ee.radius_m;
        ee.radius_m = 0.5;
        ee.contact = Contact::Skate { axis_in_link, blade_length_m: 0.12, drag };
    }
    robots.push(skater);
    let agilebot = robots.iter().find(|robot| robot.name == "agilebot").unwrap();
    robots.push(sliding(agilebot, &[0.05, 0.3]));
    robots
}

/// Returns the robot with every third joint prismatic, with the given displacements per radian, m/rad.
pub fn sliding(robot: &Robot, travels_m_per_rad: &[f64]) -> Robot {
    let mut robot = Robot { name: format!("{}_sliding", robot.name), ..robot.clone() };
    for (joint, travel) in robot.joints.iter_mut().step_by(3).zip(travels_m_per_rad.iter().cycle())
    {
        joint.travel_m_per_rad = Some(*travel);
    }
    robot
}

/// Returns the robot with a spring, a damper or both at each joint.
pub fn sprung(robot: &Robot) -> Robot {
    let mut robot = Robot { name: format!("{}_sprung", robot.name), ..robot.clone() };
    for (number, joint) in robot.joints.iter_mut().enumerate() {
        joint.spring = Some(JointSpring {
            stiffness_nm_rad: [4.0, 0.0, 7.0][number % 3],
            rest_rad: [0.3, 0.0, -2.0][number % 3],
            damping_nm_s_rad: [0.2, 0.5, 0.0][number % 3],
        });
    }
    robot
}

/// Assumed mass of a wheel, kg: a tenth of its link, shared by the wheels on the link.
pub fn wheel_mass_kg(robot: &Robot, wheel: &EndEffector) -> f64 {
    let on_link = robot.end_effectors.iter().filter(|other| other.link == wheel.link).count();
    0.1 * robot.links[wheel.link].mass_kg / on_link as f64
}

/// Tree of a robot with armature and spinning wheels, which are thin discs.
pub fn full_tree(robot: &Robot) -> Tree {
    let disc = |wheel: &EndEffector| 0.5 * wheel_mass_kg(robot, wheel) * wheel.radius_m.powi(2);
    Tree::new(robot).with_spinning_wheels(disc).with_armature()
}

/// Configuration with velocity, acceleration and forces.
#[derive(Clone, Debug)]
pub struct State {
    pub base_position_m: Vector3<f64>,
    pub world_from_body: UnitQuaternion<f64>,
    pub joint_rad: Vec<f64>,
    pub velocity: Vec<f64>,
    pub acceleration: Vec<f64>,
    pub force: Vec<f64>,
    pub gravity_m_s2: Vector3<f64>,
    /// Unit normal of the ground.
    pub normal: Vector3<f64>,
}

impl State {
    /// Random state with joints within their limits, and all other values of order 1.
    pub fn random(tree: &Tree, rng: &mut fastrand::Rng) -> Self {
        let normal = vector(rng);
        Self {
            base_position_m: vector(rng),
            world_from_body: UnitQuaternion::new(vector(rng) * 3.0),
            joint_rad: tree
                .robot()
                .joints
                .iter()
                .map(|j| j.position_min_rad + rng.f64() * (j.position_max_rad - j.position_min_rad))
                .collect(),
            velocity: numbers(tree.dofs(), 3.0, rng),
            acceleration: numbers(tree.dofs(), 10.0, rng),
            force: numbers(tree.dofs(), 1.0, rng),
            gravity_m_s2: vector(rng) * 9.81,
            normal: normal.normalize(),
        }
    }

    pub fn configuration(&self) -> Configuration<'_> {
        Configuration {
            base_position_m: self.base_position_m,
            world_from_body: self.world_from_body.to_rotation_matrix().into_inner(),
            joint_rad: &self.joint_rad,
        }
    }

    /// State after a time with constant ν.
    pub fn after(&self, time_s: f64) -> Self {
        let v = &self.velocity;
        let turn = Rotation3::new(Vector3::new(v[3], v[4], v[5]) * time_s);
        let joints = self.joint_rad.iter().enumerate();
        Self {
            base_position_m: self.base_position_m + Vector3::new(v[0], v[1], v[2]) * time_s,
            world_from_body: UnitQuaternion::from_rotation_matrix(&turn) * self.world_from_body,
            joint_rad: joints.map(|(j, angle)| angle + v[6 + j] * time_s).collect(),
            ..self.clone()
        }
    }

    /// State with another ν.
    pub fn with_velocity(&self, velocity: Vec<f64>) -> Self {
        Self { velocity, ..self.clone() }
    }
}

/// Uniform random numbers between ±`size`.
pub fn numbers(count: usize, size: f64, rng: &mut fastrand::Rng) -> Vec<f64> {
    (0..count).map(|_| size * (2.0 * rng.f64() - 1.0)).collect()
}

/// Random vector in the cube ±1.
pub fn vector(rng: &mut fastrand::Rng) -> Vector3<f64> {
    Vector3::from_vec(numbers(3, 1.0, rng))
}

/// Checks three random states of each robot, with spinning wheels and armature.
pub fn for_random_states(check: impl Fn(&Tree, &State)) {
    for robot in all() {
        let tree = full_tree(&robot);
        let mut rng = fastrand::Rng::with_seed(7);
        for _ in 0..3 {
            check(&tree, &State::random(&tree, &mut rng));
        }
    }
}

/// Robot of one link, without joints or end effectors.
pub fn body(mass_kg: f64, inertia_kg_m2: [f64; 3]) -> Robot {
    Robot {
        name: "body".into(),
        links: vec![rollwalk_robot::Link {
            name: "body".into(),
            mass_kg,
            com_in_link_m: Vector3::zeros(),
            inertia_in_link_kg_m2: Matrix3::from_diagonal(&inertia_kg_m2.into()),
            shapes: vec![],
        }],
        joints: vec![],
        end_effectors: vec![],
        buses: Default::default(),
        clearance_margin_m: DEFAULT_CLEARANCE_MARGIN_M,
    }
}
