//! Robots of the robot files on the ground.

use rollwalk_physics::World;
use rollwalk_physics::ground::{Ground, Plane};
use rollwalk_physics::motor::Law;
use rollwalk_physics::soft::Material;
use rollwalk_physics::world::{Parameters, SoftFeet};
use rollwalk_robot::{Channel, Robot};
use std::sync::Arc;

const STEP_S: f64 = 1.0 / 60.0;

fn robot(name: &str) -> Robot {
    let path = format!("{}/../robots/{name}.toml", env!("CARGO_MANIFEST_DIR"));
    Robot::from_toml(name, &std::fs::read_to_string(path).unwrap()).unwrap()
}

fn standing(robot: &Robot, ground: Plane, parameters: &Parameters) -> World {
    let ground: Arc<dyn Ground> = Arc::new(ground);
    World::standing(robot, &ground, parameters)
}

#[test]
fn a_standing_robot_bears_its_weight_and_hardly_creeps() {
    for name in ["agilebot", "legbot", "swizzlebot", "anymal_wheels"] {
        let robot = robot(name);
        let mut world = standing(&robot, Plane::level(), &Parameters::new(&robot));
        let mut iterations = 0;
        for _ in 0..240 {
            iterations += world.step(STEP_S).unwrap().iterations;
        }
        let weight: f64 = robot.links.iter().map(|link| link.mass_kg).sum::<f64>() * 9.81;
        let touches: Vec<_> = (0..robot.end_effectors.len()).map(|k| world.touch(k)).collect();
        let borne: f64 = touches.iter().map(|touch| touch.force.z).sum();
        assert!((borne / weight - 1.0).abs() < 1e-3, "{name}: {borne} of {weight} N");
        let (_, velocity) = world.com();
        assert!(velocity.norm() < 1e-3, "{name}: {velocity:?}");
        assert!(iterations < 4 * 240, "{name}: {iterations} iterations");
    }
}

/// Speed of a robot whose drives only damp: what creeps under the wheels, and what the drives let roll.
#[test]
fn on_an_incline_a_robot_rolls_with_the_droop_of_its_drives() {
    let robot = robot("agilebot");
    let angle_rad = 10f64.to_radians();
    let parameters = Parameters { stick_n_s_m: 300.0, ..Parameters::new(&robot) };
    let mut world = standing(&robot, Plane::rising(angle_rad), &parameters);
    for _ in 0..360 {
        world.step(STEP_S).unwrap();
    }
    let mass: f64 = robot.links.iter().map(|link| link.mass_kg).sum();
    let down = mass * 9.81 * angle_rad.sin();
    let wheel = &robot.end_effectors[0];
    let drive = wheel.contact.actuator().unwrap();
    let expected = down / (4.0 * 300.0) + down * wheel.radius_m.powi(2) / (4.0 * drive.kd_nm_s_rad);
    let speed = world.com().1.norm();
    assert!((speed / expected - 1.0).abs() < 0.02, "{speed}, {expected}");
}

#[test]
fn wheels_that_are_driven_roll_without_slip() {
    let robot = robot("agilebot");
    let mut world = standing(&robot, Plane::level(), &Parameters::new(&robot));
    for _ in 0..60 {
        world.step(STEP_S).unwrap();
    }
    for (number, channel) in robot.channels().enumerate() {
        if let Channel::Wheel(_, actuator) = channel {
            let law = Law { speed_rad_s: 3.0, ..Law::servo(actuator) };
            world.set_law(number, law);
        }
    }
    let mut iterations = 0;
    for _ in 0..120 {
        let report = world.step(STEP_S).unwrap();
        assert_eq!(report.subdivisions, 0, "{report:?}");
        iterations += report.iterations;
    }
    assert!(iterations < 4 * 120, "{iterations} iterations");
    let speed = world.com().1.x;
    let expected = 3.0 * robot.end_effectors[0].radius_m;
    assert!((speed / expected - 1.0).abs() < 0.01, "{speed}, {expected}");
}

/// Soft feet bear what rigid ones do, and sink by their own softness.
#[test]
fn a_robot_stands_on_soft_feet() {
    for name in ["legbot", "creature3"] {
        let robot = robot(name);
        let rigid = Parameters::new(&robot);
        let material = Material { viscosity_pa_s: 5.0, ..Material::elastic(100.0, 2e5, 0.3) };
        let soft_feet = Some(SoftFeet { material, cells: 2, attach_n_m: rigid.joint_n_m });
        let mut world = standing(&robot, Plane::level(), &Parameters { soft_feet, ..rigid });
        let bodies = world.system().bodies();
        assert_eq!(bodies.len(), robot.links.len() + 4 * 27, "{name}");
        let weight: f64 = bodies.iter().map(|body| body.mass_kg() * 9.81).sum();
        for _ in 0..180 {
            world.step(STEP_S).unwrap();
        }
        let borne: f64 = (0..robot.end_effectors.len()).map(|k| world.touch(k).force.z).sum();
        assert!((borne / weight - 1.0).abs() < 1e-3, "{name}: {borne} of {weight} N");
        let (_, velocity) = world.com();
        assert!(velocity.norm() < 1e-3, "{name}: {velocity:?}");
    }
}
