//! Load of each joint's motor while the body is held level and still: inertia, weight and spring.
//!
//! The load consists of the diagonal of the mass matrix, and of the generalised forces of the weight and of springs and dampers
//! in the present pose. It excludes coupling between joints, Coriolis terms and the ground.

use nalgebra::{Matrix3, Matrix3xX, Vector3};
use rollwalk_multibody::{CompositeInertia, Configuration, Frames, JOINTS, Tree};
use rollwalk_robot::GRAVITY_M_S2;

/// Load of one joint.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct JointLoad {
    /// Inertia about the joint axis, kg·m².
    pub inertia_kg_m2: f64,
    /// Torque of weight, spring and damper about the joint axis, N·m.
    pub torque_nm: f64,
    /// Stiffness of the spring, N·m/rad.
    pub stiffness_nm_rad: f64,
    /// Damping, N·m·s/rad.
    pub damping_nm_s_rad: f64,
}

/// Load of the motor of every joint at motor angles and speeds. A coupled motor has the inertia of its joints while the other
/// motors stand.
pub fn motor_loads(tree: &Tree, motor_rad: &[f64], motor_rad_s: &[f64]) -> Vec<JointLoad> {
    let transmission = tree.transmission();
    let joint_rad = transmission.joints(motor_rad);
    let ratios = transmission.at(&joint_rad);
    let mut joints = joint_loads(tree, &joint_rad);
    let moving = joint_rad.iter().zip(ratios.joints(motor_rad_s));
    for ((load, joint), (&angle_rad, speed_rad_s)) in
        joints.iter_mut().zip(&tree.robot().joints).zip(moving)
    {
        if let Some(spring) = &joint.spring {
            load.torque_nm += spring.torque_nm(angle_rad, speed_rad_s);
            load.stiffness_nm_rad = spring.stiffness_nm_rad;
            load.damping_nm_s_rad = spring.damping_nm_s_rad;
        }
    }
    let motor = |motor: usize| {
        let factors = ratios.torque_factors(motor).iter();
        let loads = factors.map(|of| (of.ratio, joints[of.joint]));
        let add = |sum: JointLoad, (factor, load): (f64, JointLoad)| JointLoad {
            inertia_kg_m2: sum.inertia_kg_m2 + factor * factor * load.inertia_kg_m2,
            torque_nm: sum.torque_nm + factor * load.torque_nm,
            stiffness_nm_rad: sum.stiffness_nm_rad + factor * factor * load.stiffness_nm_rad,
            damping_nm_s_rad: sum.damping_nm_s_rad + factor * factor * load.damping_nm_s_rad,
        };
        loads.fold(JointLoad::default(), add)
    };
    (0..motor_rad.len()).map(motor).collect()
}

/// Inertia and weight of every joint at the pose `joint_rad`, in joint order. Rotors are excluded, since the tree has no
/// armature.
pub fn joint_loads(tree: &Tree, joint_rad: &[f64]) -> Vec<JointLoad> {
    let at = Configuration {
        base_position_m: Vector3::zeros(),
        world_from_body: Matrix3::identity(),
        joint_rad,
    };
    let frames = Frames::new(tree, &at);
    let composite = CompositeInertia::new(tree, &frames);
    let mut com_jacobian = Matrix3xX::zeros(tree.dofs());
    frames.com_jacobian(tree, &mut com_jacobian);
    let weight_n = -GRAVITY_M_S2 * tree.total_mass_kg();
    (0..joint_rad.len())
        .map(|joint| JointLoad {
            inertia_kg_m2: composite.joint_inertia(tree, &frames, joint),
            torque_nm: weight_n * com_jacobian[(2, JOINTS + joint)],
            ..JointLoad::default()
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{Isometry3, UnitQuaternion};
    use rollwalk_robot::shape::DEFAULT_CLEARANCE_MARGIN_M;
    use rollwalk_robot::{Actuator, Joint, Link, Robot};

    fn link(name: &str, mass_kg: f64, com: [f64; 3], inertia: [f64; 3]) -> Link {
        Link {
            name: name.into(),
            mass_kg,
            com_in_link_m: com.into(),
            inertia_in_link_kg_m2: Matrix3::from_diagonal(&inertia.into()),
            shapes: Vec::new(),
        }
    }

    fn joint(parent: usize, child: usize, origin_m: [f64; 3], axis: [f64; 3]) -> Joint {
        let actuator = Actuator {
            model: "test".into(),
            speed_max_rad_s: 8.0,
            torque_max_nm: 3.0,
            torque_speed: None,
            kp_nm_rad: 20.0,
            kd_nm_s_rad: 0.5,
            armature_kg_m2: 0.004,
            bus: 0,
            id: child as u8,
        };
        Joint {
            name: format!("joint {child}"),
            parent,
            child,
            parent_from_joint: Isometry3::new(origin_m.into(), Vector3::new(0.1, -0.2, 0.3)),
            axis_in_joint: Vector3::from(axis).normalize(),
            travel_m_per_rad: None,
            position_min_rad: -3.0,
            position_max_rad: 3.0,
            nominal_rad: 0.0,
            actuator,
            motor_per_joint: Vec::new(),
            linkage: None,
            spring: None,
        }
    }

    /// Body with a two-joint leg and a one-joint arm, all of them skew.
    fn robot() -> Robot {
        Robot {
            name: "skew".into(),
            links: vec![
                link("body", 5.0, [0.0; 3], [0.1; 3]),
                link("thigh", 0.4, [0.01, 0.02, -0.08], [1e-3, 1.2e-3, 5e-4]),
                link("shank", 0.2, [-0.02, 0.01, -0.1], [8e-4, 7e-4, 1e-4]),
                link("arm", 0.3, [0.1, 0.0, 0.05], [2e-4, 6e-4, 6e-4]),
            ],
            joints: vec![
                joint(0, 1, [0.2, 0.1, -0.05], [0.1, 1.0, 0.2]),
                joint(1, 2, [0.0, 0.02, -0.18], [0.0, 1.0, -0.3]),
                joint(0, 3, [-0.2, 0.0, 0.1], [1.0, 0.2, 0.5]),
            ],
            end_effectors: vec![],
            buses: Default::default(),
            clearance_margin_m: DEFAULT_CLEARANCE_MARGIN_M,
        }
    }

    /// Second algorithm, for comparison: replaces every link by six point masses of the same mass, centre and inertia, and
    /// moves them by chained joint transforms.
    fn point_masses(robot: &Robot, q: &[f64]) -> Vec<(f64, Vector3<f64>)> {
        let mut points = Vec::new();
        for (index, link) in robot.links.iter().enumerate() {
            let mut chain = Vec::new();
            let mut at = index;
            while let Some(j) = robot.joints.iter().position(|joint| joint.child == at) {
                chain.push(j);
                at = robot.joints[j].parent;
            }
            let pose = chain.iter().rev().fold(Isometry3::identity(), |pose, &j| {
                let joint = &robot.joints[j];
                let turn = UnitQuaternion::from_scaled_axis(joint.axis_in_joint * q[j]);
                pose * joint.parent_from_joint * turn
            });
            let diagonal = link.inertia_in_link_kg_m2.diagonal();
            for axis in 0..3 {
                // Second moment along the axis: half the sum of the other two inertias minus its own.
                let second_moment = 0.5 * (diagonal.sum() - 2.0 * diagonal[axis]);
                let offset = Vector3::ith(axis, (3.0 * second_moment / link.mass_kg).sqrt());
                for end in [link.com_in_link_m + offset, link.com_in_link_m - offset] {
                    points.push((link.mass_kg / 6.0, (pose * nalgebra::Point3::from(end)).coords));
                }
            }
        }
        points
    }

    #[test]
    fn agrees_with_the_energies_of_point_masses() {
        let robot = robot();
        for q in [[0.0, 0.0, 0.0], [0.4, -1.1, 0.7], [-1.3, 2.0, -0.5]] {
            let loads = joint_loads(&Tree::new(&robot), &q);
            for j in 0..3 {
                let step = 1e-5;
                let (mut up, mut down) = (q, q);
                up[j] += step;
                down[j] -= step;
                let pairs = point_masses(&robot, &up).into_iter().zip(point_masses(&robot, &down));
                let (mut inertia, mut torque) = (0.0, 0.0);
                for ((mass, high), (_, low)) in pairs {
                    let velocity = (high - low) / (2.0 * step);
                    inertia += mass * velocity.norm_squared();
                    torque -= mass * GRAVITY_M_S2 * velocity.z;
                }
                // Central differences with step 1e-5: relative error near 1e-10.
                assert!((loads[j].inertia_kg_m2 - inertia).abs() < 1e-9, "joint {j} at {q:?}");
                assert!((loads[j].torque_nm - torque).abs() < 1e-8, "joint {j} at {q:?}");
            }
        }
    }
}
