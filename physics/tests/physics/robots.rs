//! Tests of shipped robots on the ground.

use nalgebra::{Matrix3, Vector3};
use rollwalk_multibody::ground::{Ground, Plane};
use rollwalk_multibody::{Kinematics, Tree};
use rollwalk_physics::friction::FrictionModel;
use rollwalk_physics::motor::Law;
use rollwalk_physics::world::{Parameters, RobotState};
use rollwalk_physics::{Scheme, World};
use rollwalk_robot::{Channel, GRAVITY_M_S2, Robot, SoftMaterial};
use std::f64::consts::TAU;
use std::sync::Arc;

const STEP_S: f64 = 1.0 / 60.0;

fn robot(name: &str) -> Robot {
    let path = format!("{}/../shipped/robots/{name}.toml", env!("CARGO_MANIFEST_DIR"));
    Robot::from_toml(name, &std::fs::read_to_string(path).unwrap()).unwrap()
}

fn standing(robot: &Robot, ground: Plane, parameters: &Parameters) -> World {
    let ground: Arc<dyn Ground> = Arc::new(ground);
    World::standing(robot, &ground, parameters)
}

#[test]
fn a_standing_robot_bears_its_weight_and_hardly_creeps() {
    let names = ["agilebot", "legbot", "swizzlebot", "anymal_wheels"];
    for (name, scheme) in names.iter().flat_map(|name| [(name, Scheme::Bdf1), (name, Scheme::Bdf2)])
    {
        let robot = robot(name);
        let mut parameters = Parameters::new(&robot);
        parameters.settings.scheme = scheme;
        let mut world = standing(&robot, Plane::level(), &parameters);
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

/// Tests the speed of a robot on an incline whose drives only damp: creep of the wheels' contacts plus roll of the drives.
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
    // The pose of a wheel contains the angle of its motor except for whole turns.
    let shaft_rad = world.shaft(robot.joints.len())[0];
    let wheel_rad = world.wheel_rad(0, &robot.end_effectors[0]).unwrap();
    let turns = (shaft_rad - wheel_rad) / TAU;
    assert!(shaft_rad > 5.0 && (turns - turns.round()).abs() < 1e-3, "{shaft_rad}, {wheel_rad}");
}

/// Tests that soft feet bear the same load as rigid ones, and sink further by their own compliance.
#[test]
fn a_robot_stands_on_soft_feet() {
    for name in ["legbot", "creature3"] {
        let mut robot = robot(name);
        let rigid_kg: f64 = robot.links.iter().map(|link| link.mass_kg).sum();
        let material =
            SoftMaterial { young_pa: 2e5, poisson: 0.3, density_kg_m3: 100.0, viscosity_pa_s: 5.0 };
        robot.end_effectors.iter_mut().for_each(|foot| foot.soft = Some(material));
        let mut world = standing(&robot, Plane::level(), &Parameters::new(&robot));
        let bodies = world.system().bodies();
        assert_eq!(bodies.len(), robot.links.len() + 4 * 27, "{name}");
        let weight: f64 = bodies.iter().map(|body| body.mass_kg() * 9.81).sum();
        assert!((weight / (9.81 * rigid_kg) - 1.0).abs() < 1e-12, "{name}: {weight}");
        for _ in 0..180 {
            world.step(STEP_S).unwrap();
        }
        let borne: f64 = (0..robot.end_effectors.len()).map(|k| world.touch(k).force.z).sum();
        assert!((borne / weight - 1.0).abs() < 1e-3, "{name}: {borne} of {weight} N");
        let (_, velocity) = world.com();
        assert!(velocity.norm() < 1e-3, "{name}: {velocity:?}");
    }
}

/// Tests that a robot's feet creep on an incline, and that hybrid friction holds them. The mean creep speed is the ratio of
/// downhill force to sticking stiffness.
#[test]
fn on_an_incline_hybrid_friction_holds_a_robot() {
    let robot = robot("legbot");
    let angle_rad = 10f64.to_radians();
    let mass: f64 = robot.links.iter().map(|link| link.mass_kg).sum();
    for friction in [FrictionModel::Linear, FrictionModel::Hybrid] {
        let usual = Parameters::new(&robot);
        // So soft that feet creep much faster than legs that settle.
        let stick_n_s_m = 0.25 * usual.stick_n_s_m;
        let parameters = Parameters { friction, stick_n_s_m, ..usual };
        let mut world = standing(&robot, Plane::rising(angle_rad), &parameters);
        let mut iterations = 0;
        for _ in 0..360 {
            let report = world.step(STEP_S).unwrap();
            assert_eq!(report.subdivisions, 0, "{friction:?}: {report:?}");
            iterations += report.iterations;
        }
        assert!(iterations < 4 * 360, "{friction:?}: {iterations} iterations");
        let touches: Vec<_> = (0..4).map(|k| world.touch(k)).collect();
        let sliding = touches.iter().map(|touch| touch.sliding.norm()).sum::<f64>() / 4.0;
        let creep = mass * 9.81 * angle_rad.sin() / (4.0 * parameters.stick_n_s_m);
        match friction {
            FrictionModel::Linear => {
                assert!((sliding / creep - 1.0).abs() < 0.02, "{sliding}, {creep}")
            }
            _ => assert!(sliding < 1e-8 && world.com().1.norm() < 1e-8, "{sliding}"),
        }
        for touch in touches {
            let across = touch.force - touch.normal * touch.normal.dot(&touch.force);
            let limit = touch.friction.coefficient * touch.normal_n;
            assert!(across.norm() <= limit * (1.0 + 1e-9), "{friction:?}: {touch:?}");
        }
    }
}

/// Centre of mass of AgileBot, m, after swinging its legs and driving for two seconds. Panics on halved steps.
fn driven(scheme: Scheme, per_second: u32) -> Vector3<f64> {
    let robot = robot("agilebot");
    let mut parameters = Parameters::new(&robot);
    parameters.settings.scheme = scheme;
    let mut world = standing(&robot, Plane::level(), &parameters);
    for step in 1..=2 * per_second {
        let turn = TAU * f64::from(step) / f64::from(per_second);
        for (number, channel) in robot.channels().enumerate() {
            let mut law = Law::servo(channel.actuator());
            match channel {
                Channel::Joint(joint) => {
                    law.position_rad = joint.nominal_rad + 0.03 * (1.0 - turn.cos());
                    law.speed_rad_s = 0.03 * TAU * turn.sin();
                }
                Channel::Wheel(..) => law.speed_rad_s = 3.0 * (1.0 - turn.cos()),
            }
            world.set_law(number, law);
        }
        let report = world.step(1.0 / f64::from(per_second)).unwrap();
        assert_eq!(report.subdivisions, 0, "{scheme:?}, {per_second}: {report:?}");
    }
    world.com().0
}

/// Tests the accuracy of both schemes while wheels roll and feet stick. Impacts reduce the order of both (see [`Scheme`]).
#[test]
fn bdf2_is_much_nearer_than_backward_euler_for_robots_that_roll() {
    let exact = driven(Scheme::Bdf2, 960);
    let error = |scheme, per_second| (driven(scheme, per_second) - exact).norm();
    // 0.26 and 0.030 mm; 0.14 and 0.008 mm.
    for (per_second, times) in [(60, 5.0), (120, 10.0)] {
        let [first, second] = [Scheme::Bdf1, Scheme::Bdf2].map(|scheme| error(scheme, per_second));
        assert!(first < 5e-4 && times * second < first, "{per_second}: {first}, {second}");
    }
}

/// Leg whose body is held in the air. Its joints can turn by more than one revolution.
fn leg(range_rad: f64) -> World {
    let robot = leg_of(range_rad);
    let mut world = standing(&robot, Plane::level(), &Parameters::new(&robot));
    world.hold(Some((Vector3::z(), Matrix3::identity())));
    world
}

fn leg_of(range_rad: f64) -> Robot {
    let path = format!("{}/../shipped/robots/test_leg.toml", env!("CARGO_MANIFEST_DIR"));
    let text = std::fs::read_to_string(path).unwrap();
    let text =
        text.replace("position_min_rad = -1.5", &format!("position_min_rad = -{range_rad:?}"));
    let text = text.replace("position_max_rad = 1.5", &format!("position_max_rad = {range_rad:?}"));
    Robot::from_toml("test_leg", &text).unwrap()
}

fn hip(world: &mut World, law: Law, duration_s: f64) -> f64 {
    world.set_law(0, law);
    let mut turned_rad = world.shaft(0)[0];
    // A world has no step before its first. Later steps begin here at rest.
    let mut before_rad = (world.system().time_s() > 0.0).then_some(0.0);
    for _ in 0..(duration_s * 240.0).round() as usize {
        world.step(1.0 / 240.0).unwrap();
        // The angle is the integral of the speed, and does not jump.
        let [angle_rad, speed_rad_s, _] = world.shaft(0);
        // BDF2 uses two changes, backward Euler one.
        let change_rad = angle_rad - turned_rad;
        let by_speed_rad = before_rad.map_or(change_rad, |before| 1.5 * change_rad - 0.5 * before);
        assert!((by_speed_rad - speed_rad_s / 240.0).abs() < 2e-3, "{angle_rad}");
        (turned_rad, before_rad) = (angle_rad, Some(change_rad));
    }
    turned_rad
}

#[test]
fn a_servo_turns_a_joint_more_than_once_and_back() {
    let mut world = leg(6.25);
    let servo = Law { kp_nm_rad: 60.0, kd_nm_s_rad: 3.0, limit_nm: 9.0, ..Law::default() };
    for target_rad in [6.0, -6.0, 0.5] {
        let angle_rad = hip(&mut world, Law { position_rad: target_rad, ..servo }, 6.0);
        // The deflection by the weight of the leg is limited by the gain.
        assert!((angle_rad - target_rad).abs() < 0.05, "{angle_rad} of {target_rad}");
    }
}

#[test]
fn a_world_begins_with_the_turns_of_its_state() {
    let robot = leg_of(6.0);
    let mut state = RobotState::nominal(&robot, Vector3::z());
    state.joint_rad = vec![4.0, -5.5];
    let ground: Arc<dyn Ground> = Arc::new(Plane::level());
    let world = World::new(&robot, &ground, &Parameters::new(&robot), &state);
    for (channel, expected) in [(0, 4.0), (1, -5.5)] {
        assert!((world.shaft(channel)[0] - expected).abs() < 1e-9);
    }
}

#[test]
fn a_joint_ends_at_its_stop_beyond_half_a_turn() {
    for range_rad in [3.1, 5.0] {
        for side in [1.0, -1.0] {
            let mut world = leg(range_rad);
            let push =
                Law { torque_nm: 6.0 * side, kd_nm_s_rad: 0.5, limit_nm: 9.0, ..Law::default() };
            let angle_rad = side * hip(&mut world, push, 8.0);
            assert!((0.0..0.03).contains(&(angle_rad - range_rad)), "{angle_rad} of {range_rad}");
        }
    }
}

/// Two links that turn about the vertical through both centres of mass, with a rotor, spring and damper between them.
const TWO_LINKS: &str = r#"name = "two_links"

[actuator.servo]
model = "S1"
speed_max_rad_s = 20.0
torque_max_nm = 2.0
kp_nm_rad = 50.0
kd_nm_s_rad = 1.0
armature_kg_m2 = 0.002

[[link]]
name = "body"
mass_kg = 1.0
com_in_link_m = [0.0, 0.0, 0.0]
inertia_in_link_kg_m2 = [0.01, 0.01, 0.012, 0.0, 0.0, 0.0]

[[link]]
name = "tail"
mass_kg = 0.5
com_in_link_m = [0.0, 0.0, -0.1]
inertia_in_link_kg_m2 = [0.003, 0.003, 0.004, 0.0, 0.0, 0.0]

[[joint]]
name = "tail"
parent = "body"
child = "tail"
origin_in_parent_m = [0.0, 0.0, -0.1]
axis_in_joint = [0.0, 0.0, 1.0]
position_min_rad = -3.0
position_max_rad = 3.0
nominal_rad = 0.0
actuator = "servo"
bus = 0
id = 1
spring = { stiffness_nm_rad = 3.0, rest_rad = 0.4, damping_nm_s_rad = 0.01 }

[[end_effector]]
name = "foot"
link = "tail"
center_in_link_m = [0.0, 0.0, -0.2]
radius_m = 0.02
friction_coefficient = 0.8
contact = "point_foot"
"#;

/// Tests a free robot without gravity against the closed form of a damped oscillation. The inertia of the oscillation is that of
/// both links in series, and that of the rotor.
#[test]
fn a_joint_with_a_spring_oscillates_with_its_period_and_damping() {
    let robot = Robot::from_toml("two_links.toml", TWO_LINKS).unwrap();
    oscillates(&robot, 0.012 * 0.004 / (0.012 + 0.004) + 0.002);
}

/// Masses of both links in series oscillate along the axis, seen at the pinion.
#[test]
fn a_prismatic_joint_with_a_spring_oscillates_with_its_period_and_damping() {
    let travel_m = 0.1;
    let slide = "kind = \"prismatic\"\ntravel_m_per_rad = 0.1\nposition_min_m = -0.3\nposition_max_m = 0.3\nnominal_m = 0.0\n";
    let spring = "{ stiffness_n_m = 300.0, rest_m = 0.04, damping_n_s_m = 1.0 }";
    let text = TWO_LINKS
        .replacen("position_min_rad = -3.0\nposition_max_rad = 3.0\nnominal_rad = 0.0\n", slide, 1)
        .replacen("{ stiffness_nm_rad = 3.0, rest_rad = 0.4, damping_nm_s_rad = 0.01 }", spring, 1);
    let robot = Robot::from_toml("two_links.toml", &text).unwrap();
    assert!((robot.joints[0].spring.unwrap().stiffness_nm_rad - 3.0).abs() < 1e-12);
    oscillates(&robot, 1.0 * 0.5 / (1.0 + 0.5) * travel_m * travel_m + 0.002);
}

/// Compares the joint of two free links with a damped oscillator of the given inertia.
fn oscillates(robot: &Robot, inertia_kg_m2: f64) {
    let spring = robot.joints[0].spring.unwrap();
    let mut parameters = Parameters::new(robot);
    parameters.settings.gravity_m_s2 = Vector3::zeros();
    let decay_per_s = 0.5 * spring.damping_nm_s_rad / inertia_kg_m2;
    let omega = (spring.stiffness_nm_rad / inertia_kg_m2 - decay_per_s.powi(2)).sqrt();
    let amplitude_rad = 0.5;
    let expected = |time_s: f64| {
        let (sine, cosine) = (omega * time_s).sin_cos();
        let swing = cosine + decay_per_s / omega * sine;
        spring.rest_rad + amplitude_rad * (-decay_per_s * time_s).exp() * swing
    };
    let worst_rad = |step_s: f64| {
        let mut state = RobotState::nominal(robot, Vector3::new(0.0, 0.0, 3.0));
        state.joint_rad[0] = spring.rest_rad + amplitude_rad;
        let ground: Arc<dyn Ground> = Arc::new(Plane::level());
        let mut world = World::new(robot, &ground, &parameters, &state);
        let steps = (2.0 * TAU / omega / step_s) as usize;
        let error = |step: usize| {
            world.step(step_s).unwrap();
            (world.joint(0)[0] - expected((step + 1) as f64 * step_s)).abs()
        };
        (0..steps).map(error).fold(0.0, f64::max)
    };
    let (coarse, fine) = (worst_rad(2e-3), worst_rad(1e-3));
    // BDF2: a phase error of (omega dt)² / 3 per radian, of 4π rad.
    assert!(fine < 5e-3 * amplitude_rad, "{fine}");
    assert!((1.7..2.3).contains(&(coarse / fine).log2()), "{coarse} and {fine}");
}

#[test]
fn sprung_toes_settle_where_the_spring_balances_ground_force_and_weight() {
    let robot = robot("pup_toes");
    let parameters = Parameters::new(&robot);
    let mut world = standing(&robot, Plane::level(), &parameters);
    for _ in 0..240 {
        world.step(STEP_S).unwrap();
    }
    let (_, rotation) = world.base();
    let pitch_rad = rotation[(0, 2)].atan2(rotation[(0, 0)]);
    for leg in 0..4 {
        let [hip, knee, toe] = [0, 1, 2].map(|joint| world.joint(3 * leg + joint)[0]);
        let (sine, cosine) = (pitch_rad + hip + knee + toe).sin_cos();
        let turned = |[x, z]: [f64; 2]| [x * cosine + z * sine, z * cosine - x * sine];
        let joint = &robot.joints[3 * leg + 2];
        let link = &robot.links[joint.child];
        let force = world.touch(leg).force;
        // Moments about +y, the axis of the toe: of the ground at the bottom of the toe, and of the weight of the foot.
        let [x, z] = turned([0.03, -0.012]);
        let ground_nm = (z - 0.008) * force.x - x * force.z;
        let [x, _] = turned([link.com_in_link_m.x, link.com_in_link_m.z]);
        let weight_nm = x * link.mass_kg * 9.806_65;
        let spring_nm = joint.spring.unwrap().torque_nm(toe, 0.0);
        let off_nm = spring_nm + ground_nm + weight_nm;
        assert!(off_nm.abs() < 0.01 * spring_nm, "{}: {off_nm} of {spring_nm} N·m", joint.name);
        let yields_rad = 0.28 - toe;
        assert!((0.05..0.12).contains(&yields_rad), "{}: {yields_rad} rad", joint.name);
    }
}

/// Tests that velocities of a world that begins with a turning body and a moving slide are those of its kinematics.
#[test]
fn a_world_begins_with_the_speeds_of_its_slides() {
    let robot = robot("pup_linear");
    let mut state = RobotState::nominal(&robot, Vector3::z());
    state.base_spin_rad_s = Vector3::new(0.4, -1.1, 0.7);
    state.base_velocity_m_s = Vector3::new(0.3, 0.1, -0.2);
    for (joint, speed) in state.joint_rad_s.iter_mut().enumerate() {
        *speed = 0.5 + joint as f64;
    }
    let ground: Arc<dyn Ground> = Arc::new(Plane::level());
    let world = World::new(&robot, &ground, &Parameters::new(&robot), &state);
    let tree = Tree::new(&robot);
    let found = world.state(&tree);
    for joint in 0..robot.joints.len() {
        let [angle_rad, speed_rad_s] = world.joint(joint);
        assert!((angle_rad - state.joint_rad[joint]).abs() < 1e-9, "{joint}: {angle_rad}");
        assert!((speed_rad_s - state.joint_rad_s[joint]).abs() < 1e-9, "{joint}: {speed_rad_s}");
    }
    let mut kinematics = Kinematics::new(&tree, &found.configuration());
    kinematics.update(&tree, &found.configuration(), &found.velocity);
    for (link, motion) in world.system().motions().iter().take(robot.links.len()).enumerate() {
        let com = kinematics.frames.link_com(&tree, link);
        assert!((com - motion.position).norm() < 1e-9, "{link}");
        let velocity = kinematics.point_velocity(link, &com);
        assert!(
            (velocity - motion.velocity).norm() < 1e-9,
            "{link}: {velocity} {}",
            motion.velocity
        );
    }
}

/// A robot on telescopic legs stands: its servos carry the weight by the force of their pinions.
#[test]
fn telescopic_legs_carry_the_weight() {
    let robot = robot("pup_linear");
    let parameters = Parameters::new(&robot);
    let mut world = standing(&robot, Plane::level(), &parameters);
    for _ in 0..240 {
        world.step(STEP_S).unwrap();
    }
    let travel_m = robot.joints[1].travel_m_per_rad.unwrap();
    let hoisted_n: f64 = (0..4).map(|leg| world.shaft(2 * leg + 1)[2] / travel_m).sum();
    let shins_kg: f64 =
        (0..4).map(|leg| robot.links[robot.joints[2 * leg + 1].child].mass_kg).sum();
    let expected_n = (robot.total_mass_kg() - shins_kg) * GRAVITY_M_S2;
    // Legs lean by less than 0.1 rad on their servos.
    assert!((hoisted_n / expected_n - 1.0).abs() < 0.01, "{hoisted_n} of {expected_n} N");
}
