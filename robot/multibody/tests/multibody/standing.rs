//! Tests of standing robots against manual statics and against inverse dynamics.

use crate::robots::{self, body};
use nalgebra::{Isometry3, Matrix3, Vector3};
use rollwalk_multibody::{Configuration, JOINTS, Kinematics, RimContact, Standing, Tree};
use rollwalk_robot::{Contact, EndEffector, GRAVITY_M_S2, Joint, Link, Robot};

const THIGH_M: f64 = 0.3;
const SHANK_M: f64 = 0.25;
const FOOT_M: f64 = 0.02;
/// Knee bend, rad: the thigh leans back and the shank forward by this angle.
const LEAN_RAD: f64 = 0.5;

/// Robot with a body of 8 kg on massless legs of two joints. `feet` has x and y of each leg.
fn table(feet: &[[f64; 2]], com: Vector3<f64>) -> Robot {
    let mut robot = body(8.0, [0.1, 0.1, 0.1]);
    robot.links[0].com_in_link_m = com;
    let joint = |robot: &mut Robot, parent: usize, at: [f64; 3], nominal_rad: f64| {
        let child = robot.links.len();
        robot.links.push(Link {
            name: format!("link {child}"),
            mass_kg: 1e-9,
            com_in_link_m: Vector3::zeros(),
            inertia_in_link_kg_m2: Matrix3::identity() * 1e-9,
            shapes: vec![],
        });
        robot.joints.push(Joint {
            name: format!("joint {child}"),
            parent,
            child,
            parent_from_joint: Isometry3::translation(at[0], at[1], at[2]),
            axis_in_joint: Vector3::y(),
            travel_m_per_rad: None,
            position_min_rad: -2.0,
            position_max_rad: 2.0,
            nominal_rad,
            actuator: crate::closed_forms::actuator(0.01),
            motor_per_joint: Vec::new(),
            linkage: None,
            spring: None,
        });
        child
    };
    for (number, [x, y]) in feet.iter().enumerate() {
        let thigh = joint(&mut robot, 0, [*x, *y, 0.0], LEAN_RAD);
        let shank = joint(&mut robot, thigh, [0.0, 0.0, -THIGH_M], -2.0 * LEAN_RAD);
        robot.end_effectors.push(EndEffector {
            name: format!("foot {number}"),
            link: shank,
            center_in_link_m: Vector3::new(0.0, 0.0, -SHANK_M),
            radius_m: FOOT_M,
            friction_coefficient: 0.7,
            contact: Contact::PointFoot,
            soft: None,
        });
    }
    robot
}

const CORNERS: [[f64; 2]; 4] = [[0.2, 0.1], [0.2, -0.1], [-0.2, 0.1], [-0.2, -0.1]];

#[test]
fn a_table_on_bent_legs_is_as_by_hand() {
    // Feet are behind the hips by the difference of the two links.
    let foot_x = (SHANK_M - THIGH_M) * LEAN_RAD.sin();
    let robot = table(&CORNERS, Vector3::new(foot_x, 0.0, 0.0));
    let standing = Standing::new(&Tree::new(&robot)).unwrap();
    let height = (THIGH_M + SHANK_M) * LEAN_RAD.cos() + FOOT_M;
    // The masses of the legs are 1e-9 of the body's.
    assert!((standing.com.z - height).abs() < 1e-8);
    let share = 8.0 * GRAVITY_M_S2 / 4.0;
    let kp = robot.joints[0].actuator.kp_nm_rad;
    assert!(standing.balanced);
    for (leg, contact) in standing.contacts.iter().enumerate() {
        assert!((contact.force_n - share).abs() < 1e-6);
        assert!(contact.position.z.abs() < 1e-12);
        // A force upward at x, relative to an axis along +y, has the moment −y x f. The motor resists it.
        let lever = [foot_x, SHANK_M * LEAN_RAD.sin()];
        let torque = lever.map(|x| x * share);
        for (joint, torque) in torque.into_iter().enumerate() {
            let found = standing.torque_nm[2 * leg + joint];
            assert!((found - torque).abs() < 1e-6, "{found} {torque}");
        }
        // Each joint deflects by τ / kp, with its lever: Σ x² f / kp, always downward.
        let sag = lever.iter().map(|x| x * x * share / kp).sum::<f64>();
        assert!((contact.sag_m - sag).abs() < 1e-9, "{} {sag}", contact.sag_m);
    }
}

#[test]
fn forces_balance_a_centre_of_mass_that_is_off_the_middle() {
    let foot_x = (SHANK_M - THIGH_M) * LEAN_RAD.sin();
    let off = Vector3::new(foot_x + 0.05, 0.02, 0.1);
    let standing = Standing::new(&Tree::new(&table(&CORNERS, off))).unwrap();
    let weight = 8.0 * GRAVITY_M_S2;
    let sum = |of: &dyn Fn(&Vector3<f64>) -> f64| -> f64 {
        standing.contacts.iter().map(|c| c.force_n * of(&c.position)).sum()
    };
    assert!((sum(&|_| 1.0) - weight).abs() < 1e-6);
    assert!((sum(&|p| p.x) - weight * off.x).abs() < 1e-6);
    assert!((sum(&|p| p.y) - weight * off.y).abs() < 1e-6);
    // The centre of mass is beyond the feet: the robot tips, and forces are equal.
    let beyond = Vector3::new(0.4, 0.0, 0.0);
    let standing = Standing::new(&Tree::new(&table(&CORNERS, beyond))).unwrap();
    assert!(!standing.balanced);
    assert!(standing.contacts.iter().all(|c| (c.force_n - weight / 4.0).abs() < 1e-6));
    // Two feet balance moments along their line, but not across it.
    let biped = table(&CORNERS[..2], Vector3::new(0.2 + foot_x, 0.05, 0.0));
    let standing = Standing::new(&Tree::new(&biped)).unwrap();
    assert!(standing.balanced);
    let forces = [0, 1].map(|foot| standing.contacts[foot].force_n / weight);
    assert!((forces[0] - 0.75).abs() < 1e-6 && (forces[1] - 0.25).abs() < 1e-6, "{forces:?}");
    let off_line = table(&CORNERS[..2], Vector3::new(0.3, 0.05, 0.0));
    assert!(!Standing::new(&Tree::new(&off_line)).unwrap().balanced);
}

#[test]
fn a_leg_that_is_too_short_hangs() {
    let mut robot = table(&CORNERS, Vector3::zeros());
    robot.end_effectors[0].center_in_link_m.z += 0.1;
    robot.links[0].com_in_link_m.x = -0.1;
    let standing = Standing::new(&Tree::new(&robot)).unwrap();
    let height = 0.1 * LEAN_RAD.cos();
    assert!((standing.contacts[0].position.z - height).abs() < 1e-12);
    assert_eq!(standing.contacts[0].force_n, 0.0);
}

/// Tests joint torques against a second algorithm: bias forces at rest minus the transposed Jacobians times the ground forces.
/// The base is free, so that its six rows show whether forces and moments balance.
#[test]
fn torques_of_shipped_robots_are_those_of_inverse_dynamics() {
    let shipped = robots::shipped();
    let sprung = shipped.iter().map(robots::sprung).collect::<Vec<_>>();
    for robot in shipped.iter().chain(&sprung) {
        let tree = Tree::new(robot);
        let standing = Standing::new(&tree).unwrap();
        // The front wheels hang in the air.
        let tips = robot.name.starts_with("car_tilted");
        assert_eq!(standing.balanced, !tips, "{}", robot.name);
        let nominal: Vec<_> = robot.joints.iter().map(|joint| joint.nominal_rad).collect();
        let at = Configuration {
            base_position_m: standing.frames.link_origins[0],
            world_from_body: Matrix3::identity(),
            joint_rad: &nominal,
        };
        let kinematics = Kinematics::new(&tree, &at);
        let mut forces = nalgebra::DVector::zeros(tree.dofs());
        kinematics.inverse_dynamics(
            &tree,
            &Vector3::new(0.0, 0.0, -GRAVITY_M_S2),
            forces.as_mut_slice(),
        );
        let mut jacobian = nalgebra::Matrix3xX::zeros(tree.dofs());
        for (index, contact) in standing.contacts.iter().enumerate() {
            let rim = RimContact::new(&tree, &standing.frames, index, &Vector3::z()).unwrap();
            rim.material_jacobian(&tree, &standing.frames, &mut jacobian);
            forces -= jacobian.transpose() * (Vector3::z() * contact.force_n);
        }
        // N and N·m of robots up to 36 kg. One foot balances no moment.
        let rows = if tips || robot.end_effectors.len() == 1 { 3 } else { 6 };
        assert!(forces.rows(0, rows).amax() < 1e-9, "{}: {forces}", robot.name);
        let joints_nm = standing.frames.ratios(&tree).joint_torques(&standing.torque_nm);
        for (joint, torque) in joints_nm.iter().enumerate() {
            assert!((forces[JOINTS + joint] - torque).abs() < 1e-9, "{}", robot.name);
        }
    }
}
