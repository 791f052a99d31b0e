//! Tests against textbook equations of mechanisms.

use crate::robots::body;
use nalgebra::{DMatrix, Isometry3, Matrix3, Vector3};
use rollwalk_multibody::{CompositeInertia, Configuration, Frames, JOINTS, Kinematics, Tree};
use rollwalk_robot::{Actuator, Contact, EndEffector, Joint, Link, Robot};

pub fn actuator(armature_kg_m2: f64) -> Actuator {
    Actuator {
        model: "test".into(),
        speed_max_rad_s: 8.0,
        torque_max_nm: 3.0,
        torque_speed: None,
        kp_nm_rad: 20.0,
        kd_nm_s_rad: 0.5,
        armature_kg_m2,
        bus: 0,
        id: 1,
    }
}

const ARMATURE: f64 = 0.004;
const L1: f64 = 0.3;
const LC: [f64; 2] = [0.1, 0.15];
const M: [f64; 2] = [0.7, 0.4];
const I: [f64; 2] = [0.003, 0.002];

/// Arm of two links in the x-y plane that turn about z, on a body at the origin.
fn two_link_arm() -> Robot {
    let mut robot = body(5.0, [0.1, 0.1, 0.1]);
    for k in 0..2 {
        robot.links.push(Link {
            name: format!("link {k}"),
            mass_kg: M[k],
            com_in_link_m: Vector3::new(LC[k], 0.0, 0.0),
            inertia_in_link_kg_m2: Matrix3::from_diagonal(&Vector3::new(1e-4, I[k], I[k])),
            shapes: vec![],
        });
        robot.joints.push(Joint {
            name: format!("joint {k}"),
            parent: k,
            child: k + 1,
            parent_from_joint: Isometry3::translation(k as f64 * L1, 0.0, 0.0),
            axis_in_joint: Vector3::z(),
            travel_m_per_rad: None,
            position_min_rad: -3.0,
            position_max_rad: 3.0,
            nominal_rad: 0.0,
            actuator: actuator(ARMATURE),
            motor_per_joint: Vec::new(),
            linkage: None,
            spring: None,
        });
    }
    robot
}

fn at(joint_rad: &[f64]) -> Configuration<'_> {
    Configuration {
        base_position_m: Vector3::zeros(),
        world_from_body: Matrix3::identity(),
        joint_rad,
    }
}

#[test]
fn a_two_link_arm_has_its_textbook_equations() {
    let tree = Tree::new(&two_link_arm()).with_armature();
    let (q, v, g) = ([0.7f64, -1.9], [1.3, -2.1], 9.81);
    let frames = Frames::new(&tree, &at(&q));
    let mut m = DMatrix::zeros(8, 8);
    CompositeInertia::new(&tree, &frames).mass_matrix(&tree, &frames, &mut m);
    let (s2, c2) = q[1].sin_cos();
    let m22 = I[1] + M[1] * LC[1] * LC[1];
    let m12 = m22 + M[1] * L1 * LC[1] * c2;
    let m11 = I[0] + M[0] * LC[0] * LC[0] + M[1] * L1 * L1 + 2.0 * m12 - m22;
    let expected = [[m11 + ARMATURE, m12], [m12, m22 + ARMATURE]];
    for (row, column) in [(0, 0), (0, 1), (1, 0), (1, 1)] {
        let error = m[(JOINTS + row, JOINTS + column)] - expected[row][column];
        assert!(error.abs() < 1e-15, "{row} {column}: {error}"); // rounding
    }

    let mut arm = Kinematics::new(&tree, &at(&q));
    arm.update(&tree, &at(&q), &[0.0, 0.0, 0.0, 0.0, 0.0, 0.0, v[0], v[1]]);
    let mut bias = [0.0; 8];
    arm.inverse_dynamics(&tree, &Vector3::new(0.0, -g, 0.0), &mut bias);
    let coupling = M[1] * L1 * LC[1] * s2;
    let outer = M[1] * LC[1] * g * (q[0] + q[1]).cos();
    let expected = [
        -coupling * (2.0 * v[0] * v[1] + v[1] * v[1])
            + (M[0] * LC[0] + M[1] * L1) * g * q[0].cos()
            + outer,
        coupling * v[0] * v[0] + outer,
    ];
    for k in 0..2 {
        assert!((bias[JOINTS + k] - expected[k]).abs() < 1e-14, "{k}: {}", bias[JOINTS + k]);
    }
}

#[test]
fn a_spinning_wheel_resists_turning_as_a_gyroscope() {
    let mut robot = body(2.0, [0.02, 0.03, 0.04]);
    robot.end_effectors.push(EndEffector {
        name: "wheel".into(),
        link: 0,
        center_in_link_m: Vector3::new(0.1, 0.0, -0.1),
        radius_m: 0.05,
        friction_coefficient: 1.0,
        contact: Contact::ActuatedWheel {
            axis_in_link: Vector3::y(),
            actuator: actuator(ARMATURE),
        },
        soft: None,
    });
    let spin_inertia = 1e-3;
    let tree = Tree::new(&robot).with_spinning_wheels(|_| spin_inertia).with_armature();
    let (spin, yaw_rate) = (100.0, 2.0);
    let mut top = Kinematics::new(&tree, &at(&[]));
    top.update(&tree, &at(&[]), &[0.0, 0.0, 0.0, 0.0, 0.0, yaw_rate, spin]);
    let mut torque = [0.0; 7];
    top.inverse_dynamics(&tree, &Vector3::zeros(), &mut torque);
    // Ω × (J s a) with Ω along z and a along y: −J s Ω about x. The body's own axes are principal axes.
    let expected = [0.0, 0.0, 0.0, -spin_inertia * spin * yaw_rate, 0.0, 0.0, 0.0];
    for k in 0..7 {
        assert!((torque[k] - expected[k]).abs() < 1e-15, "{k}: {}", torque[k]); // rounding
    }
    // Accelerating the wheel includes the rotor, but only the wheel pushes the body in the other direction.
    top.accelerate(&tree, &[0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 10.0]);
    top.inverse_dynamics(&tree, &Vector3::zeros(), &mut torque);
    assert!((torque[6] - 10.0 * (spin_inertia + ARMATURE)).abs() < 1e-15); // rounding
    assert!((torque[4] - 10.0 * spin_inertia).abs() < 1e-15); // rounding
}

/// Mass that slides along an arm at a distance r = r₀ + t φ from the axis of the arm, which turns by q.
#[test]
fn a_mass_on_a_turning_rail_has_its_equations_of_motion() {
    const TRAVEL: f64 = 0.05;
    let mut robot = two_link_arm();
    robot.joints[1].axis_in_joint = Vector3::x();
    robot.joints[1].travel_m_per_rad = Some(TRAVEL);
    robot.joints[1].actuator = actuator(0.0);
    robot.joints[0].actuator = actuator(0.0);
    let tree = Tree::new(&robot);
    let (angle, pinion) = (0.7, 1.3);
    let (speed, pinion_speed) = (0.9, -2.1);
    let (acceleration, pinion_acceleration) = (-1.7, 3.0);
    let joint_rad = [angle, pinion];
    let at = Configuration {
        base_position_m: Vector3::zeros(),
        world_from_body: Matrix3::identity(),
        joint_rad: &joint_rad,
    };
    let mut kinematics = Kinematics::new(&tree, &at);
    let mut velocity = vec![0.0; tree.dofs()];
    velocity[JOINTS..].copy_from_slice(&[speed, pinion_speed]);
    kinematics.update(&tree, &at, &velocity);
    let mut rates = vec![0.0; tree.dofs()];
    rates[JOINTS..].copy_from_slice(&[acceleration, pinion_acceleration]);
    kinematics.accelerate(&tree, &rates);
    let mut force = vec![0.0; tree.dofs()];
    let g = 9.81;
    kinematics.inverse_dynamics(&tree, &Vector3::new(0.0, -g, 0.0), &mut force);

    let r = L1 + LC[1] + TRAVEL * pinion;
    let (dr, ddr) = (TRAVEL * pinion_speed, TRAVEL * pinion_acceleration);
    let inertia = I[0] + M[0] * LC[0] * LC[0] + I[1] + M[1] * r * r;
    let torque = inertia * acceleration
        + 2.0 * M[1] * r * dr * speed
        + (M[0] * LC[0] + M[1] * r) * g * angle.cos();
    let along = M[1] * (ddr - r * speed * speed + g * angle.sin());
    assert!((force[JOINTS] - torque).abs() < 1e-12, "{} {torque}", force[JOINTS]); // rounding
    // The force of the rack at the pinion.
    let expected = along * TRAVEL;
    assert!((force[JOINTS + 1] - expected).abs() < 1e-12, "{} {expected}", force[JOINTS + 1]);
    let tip = kinematics.frames.point(2, &Vector3::new(LC[1], 0.0, 0.0));
    assert!((tip - Vector3::new(r * angle.cos(), r * angle.sin(), 0.0)).norm() < 1e-12);
}
