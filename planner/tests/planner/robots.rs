//! Motions of the shipped robots: each plan converges, and the report finds each residual within its tolerance.

use rollwalk_planner::motion::{Goal, Motion};
use rollwalk_planner::plan::{Plan, Status};
use rollwalk_planner::report::Report;
use rollwalk_planner::{Options, optimise};
use rollwalk_robot::shape::Shape;
use rollwalk_robot::{Actuator, Contact, GRAVITY_M_S2, Robot};
use std::collections::BTreeSet;
use std::fs;
use std::ops::ControlFlow;
use std::path::Path;

/// Car of thesis sec. 2.5.1, whose tilted front wheels do not roll in parallel.
const CANNOT_DRIVE: &str = "car_tilted";

/// Robot files other than [`CANNOT_DRIVE`], each with a motion file.
const MOTIONS: [(&str, &str); 20] = [
    ("agilebot", "slalom"),
    ("agilebot_sprint", "table_2_1/agilebot_start_stop"),
    ("anymal_wheels", "anymal_duck"),
    ("brainbot", "table_2_1/brainbot_turn"),
    ("car", "car_drive"),
    ("creature3", "table_2_1/creature3_walk"),
    ("dinobot", "table_2_1/dinobot_skating"),
    ("legbot", "legbot_walk"),
    ("pup", "pup_walk"),
    ("pup_belt", "pup_belt_walk"),
    ("pup_five_bar", "pup_five_bar_walk"),
    ("pup_linear", "pup_linear_walk"),
    ("pup_toes", "pup_toes_walk"),
    ("skatebot", "table_2_1/skatebot_skating"),
    ("skaterbot", "skaterbot_stand"),
    ("swizzlebot", "swizzlebot_turn"),
    ("swizzlebot2", "swizzlebot2_forward"),
    ("swizzlebot4", "swizzlebot4_forward"),
    ("swizzlebot5", "swizzlebot5_forward"),
    ("test_leg", "test_leg_roll"),
];

fn text(folder: &str, name: &str) -> String {
    let root = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../shipped"));
    fs::read_to_string(root.join(folder).join(format!("{name}.toml"))).unwrap()
}

fn plan(robot_name: &str, motion_name: &str) -> Plan {
    let robot = Robot::from_toml(robot_name, &text("robots", robot_name)).unwrap();
    let motion = Motion::from_toml(motion_name, &text("motions", motion_name), &robot).unwrap();
    optimise(&robot, &motion, &Options::default(), &mut |_| ControlFlow::Continue(()))
}

#[test]
fn every_robot_plans_a_motion_that_holds() {
    for (robot_name, motion_name) in MOTIONS {
        let plan = plan(robot_name, motion_name);
        assert_eq!(plan.solve.status, Status::Converged, "{motion_name} on {robot_name}");
        let report = Report::new(&plan);
        assert!(report.judgement.is_good(), "{motion_name} on {robot_name}\n{report}");
    }
}

/// Checks the springs of a walk of `pup_toes` against the moment balance of each foot in the plane of its leg, which has another
/// derivation than planner and report.
#[test]
fn springs_of_toes_balance_ground_force_and_weight() {
    let plan = plan("pup_toes", "pup_toes_walk");
    let robot = &plan.robot;
    let mut loaded = 0;
    for sample in &plan.samples {
        for (leg, end) in sample.end_effectors.iter().enumerate() {
            let [hip, knee, toe] = [0, 1, 2].map(|joint| sample.joint_rad[3 * leg + joint]);
            let pitch_rad = sample.base_yaw_pitch_roll_rad[1] + hip + knee + toe;
            let turned = |[x, z]: [f64; 2]| {
                [
                    x * pitch_rad.cos() + z * pitch_rad.sin(),
                    z * pitch_rad.cos() - x * pitch_rad.sin(),
                ]
            };
            let moment = |[x, z]: [f64; 2], force: [f64; 2]| z * force[0] - x * force[1];
            let joint = &robot.joints[3 * leg + 2];
            let [x, z] = turned([0.03, -0.012]);
            let ground_nm = moment([x, z - 0.008], [end.force_n[0], end.force_n[2]]);
            let link = &robot.links[joint.child];
            let com = turned([link.com_in_link_m.x, link.com_in_link_m.z]);
            let weight_nm = moment(com, [0.0, -GRAVITY_M_S2 * link.mass_kg]);
            let spring_nm = joint.spring.expect("a spring").torque_nm(toe, 0.0);
            // The rest are damping, and the inertia of a foot of 8 g.
            let off_nm = spring_nm + ground_nm + weight_nm;
            assert!(off_nm.abs() < 0.006, "{}: {off_nm} N·m at {} s", joint.name, sample.time_s);
            loaded += usize::from(spring_nm > 0.03);
        }
    }
    assert!(loaded > 60, "{loaded} loaded feet");
    assert!(sample_torques(&plan).iter().all(|torque_nm| torque_nm.abs() < 0.01));
}

/// Torques of toes in a plan of `pup_toes`, which no motor supplies.
fn sample_torques(plan: &Plan) -> Vec<f64> {
    let toes = plan.samples.iter().flat_map(|s| s.joint_torque_nm.iter().skip(2).step_by(3));
    toes.copied().collect()
}

/// Scales a motor of a robot whose lengths grow by `s`: times grow by √s, masses by s³, torques by s⁴.
fn scale_motor(motor: &mut Actuator, s: f64) {
    motor.speed_max_rad_s /= s.sqrt();
    motor.torque_max_nm *= s.powi(4);
    motor.kp_nm_rad *= s.powi(4);
    motor.kd_nm_s_rad *= s.powf(4.5);
    motor.armature_kg_m2 *= s.powi(5);
    if let Some(line) = &mut motor.torque_speed {
        line.stall_torque_nm *= s.powi(4);
        line.no_load_speed_rad_s /= s.sqrt();
    }
}

/// Robot of the same shape and material with the given mass, on buses without settings.
fn of_mass(mut robot: Robot, mass_kg: f64) -> (Robot, f64) {
    let s = (mass_kg / robot.total_mass_kg()).cbrt();
    for link in &mut robot.links {
        link.mass_kg *= s.powi(3);
        link.com_in_link_m *= s;
        link.inertia_in_link_kg_m2 *= s.powi(5);
        for shape in &mut link.shapes {
            match shape {
                Shape::Capsule { from_in_link_m, to_in_link_m, radius_m } => {
                    *from_in_link_m *= s;
                    *to_in_link_m *= s;
                    *radius_m *= s;
                }
                Shape::Box { center_in_link_m, size_m } => {
                    *center_in_link_m *= s;
                    *size_m *= s;
                }
            }
        }
    }
    for joint in &mut robot.joints {
        joint.parent_from_joint.translation.vector *= s;
        scale_motor(&mut joint.actuator, s);
    }
    for end in &mut robot.end_effectors {
        end.center_in_link_m *= s;
        end.radius_m *= s;
        if let Contact::ActuatedWheel { actuator, .. } = &mut end.contact {
            scale_motor(actuator, s);
        }
    }
    robot.clearance_margin_m *= s;
    robot.buses.clear();
    (robot, s)
}

/// Checks that robots of 0.2 kg and 500 kg meet no absolute threshold of robot file, planner or report.
#[test]
fn small_and_large_robots_walk() {
    for (name, motion_name, mass_kg) in
        [("pup", "pup_walk", 0.2), ("anymal_wheels", "anymal_walk", 500.0)]
    {
        let robot = Robot::from_toml(name, &text("robots", name)).unwrap();
        let (robot, s) = of_mass(robot, mass_kg);
        robot.validate().unwrap();
        robot.controller_config().unwrap().check().unwrap();
        let motion = Motion::from_toml(motion_name, &text("motions", motion_name), &robot).unwrap();
        let motion = Motion {
            duration_s: (motion.duration_s * s.sqrt() * 60.0).round() / 60.0,
            swing_height_m: motion.swing_height_m * s,
            goal: Goal { forward_m: motion.goal.forward_m.map(|way| way * s), ..motion.goal },
            ..motion
        };
        let plan =
            optimise(&robot, &motion, &Options::default(), &mut |_| ControlFlow::Continue(()));
        assert_eq!(plan.solve.status, Status::Converged, "{motion_name} of {mass_kg} kg");
        let report = Report::new(&plan);
        assert!(report.judgement.is_good(), "{motion_name} of {mass_kg} kg\n{report}");
    }
}

#[test]
fn tilting_the_wheels_of_the_car_stops_it() {
    let plan = plan(CANNOT_DRIVE, "car_drive");
    assert_eq!(plan.solve.status, Status::Infeasible);
    let diagnosis = plan.solve.diagnosis.unwrap();
    let of_wheels =
        |subject: &String| plan.robot.end_effectors.iter().any(|ee| ee.name == *subject);
    assert_eq!(diagnosis.culprits[0].field.as_deref(), Some("forward_m"), "{diagnosis}");
    assert!(diagnosis.culprits[1].subject.as_ref().is_some_and(of_wheels), "{diagnosis}");
}

#[test]
fn no_robot_file_is_left_out() {
    let folder = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../shipped/robots"));
    let shipped: BTreeSet<String> = fs::read_dir(folder)
        .unwrap()
        .map(|entry| entry.unwrap().path().file_stem().unwrap().to_str().unwrap().to_owned())
        .collect();
    let planned = MOTIONS.iter().map(|(robot, _)| *robot).chain([CANNOT_DRIVE]);
    let planned: BTreeSet<String> = planned.map(str::to_owned).collect();
    assert_eq!(planned, shipped);
}
