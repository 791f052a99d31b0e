//! Forward kinematics of the tree with geometric Jacobians.
//!
//! A point x on a link moves by w_k × (x − o_k) per radian of the degree of freedom k above it, a
//! vector a by w_k × a, where w_k is the axis and o_k the origin of k in world. The base's yaw, pitch
//! and roll are three such axes through the base origin; its position moves everything alike.

use super::{BASE_POSITION, BASE_YAW, JOINTS, rotation};
use nalgebra::{DVector, Matrix3, Vector3};
use rollwalk_robot::Robot;

/// What kinematics needs of a robot, computed once.
#[derive(Clone, Debug)]
pub struct Model {
    robot: Robot,
    total_mass_kg: f64,
    centroidal_inertia_kg_m2: Matrix3<f64>,
    nominal_q: DVector<f64>,
    /// For each link the joints between it and the base, base first.
    joints_to_link: Vec<Vec<usize>>,
    chains: Vec<Chain>,
    carried: Vec<Carried>,
}

/// What a joint carries and what carries it.
#[derive(Clone, Debug)]
pub struct Carried {
    /// Mass of all links beyond the joint, kg.
    pub mass_kg: f64,
    /// Joints between the base and this one, base first, itself excluded.
    pub above: Vec<usize>,
    /// Joints beyond this one.
    pub below: Vec<usize>,
    /// End effectors beyond this one.
    pub end_effectors: Vec<usize>,
}

/// The degrees of freedom that move an end effector: the six of the base, then the joints of its limb.
#[derive(Clone, Debug)]
pub struct Chain {
    /// Indices into `q`, ascending from the base.
    pub dofs: Vec<usize>,
}

/// An end effector's mount in world, with derivatives along its [`Chain`].
#[derive(Clone, Debug)]
pub struct EndEffectorPose {
    /// φ_b(l̂, q): wheel centre or centre of the foot sphere, m.
    pub center: Vector3<f64>,
    /// ∂center/∂q, one column per degree of freedom of the chain.
    pub d_center: Vec<Vector3<f64>>,
    /// φ_b(â, q): wheel axis as the robot file gives it; zero for a foot.
    pub axis: Vector3<f64>,
    /// ∂axis/∂q along the chain.
    pub d_axis: Vec<Vector3<f64>>,
    /// World-from-link rotation of the mounting link.
    pub world_from_link: Matrix3<f64>,
    /// Angular velocity of the mounting link per unit rate of each degree of freedom of the chain.
    pub d_rotation: Vec<Vector3<f64>>,
}

/// Forward kinematics at one configuration.
#[derive(Clone, Debug)]
pub struct Pose {
    /// World-from-body rotation.
    pub world_from_body: Matrix3<f64>,
    /// Axes in world of the base's yaw, pitch and roll.
    pub base_axes: [Vector3<f64>; 3],
    /// Centre of mass φ_CoM(q), m.
    pub com: Vector3<f64>,
    /// ∂com/∂q, one column for every entry of `q`.
    pub d_com: Vec<Vector3<f64>>,
    /// End effectors in robot order.
    pub end_effectors: Vec<EndEffectorPose>,
    /// Origin of every link frame in world, m.
    pub link_origins: Vec<Vector3<f64>>,
    /// Axis of every joint in world, in joint order.
    pub joint_axes: Vec<Vector3<f64>>,
    /// First moment Σ m x of every link with all that it carries, kg·m in world.
    pub carried_moment: Vec<Vector3<f64>>,
}

/// Frames of all links at one configuration, in world.
struct LinkFrames {
    /// World-from-link rotations.
    rotations: Vec<Matrix3<f64>>,
    /// Link origins, m.
    origins: Vec<Vector3<f64>>,
    /// Joint axes, in joint order.
    axes: Vec<Vector3<f64>>,
}

impl Model {
    /// Prepares a robot for kinematics.
    pub fn new(robot: &Robot) -> Self {
        let mut joints_to_link = vec![Vec::new(); robot.links.len()];
        for (index, joint) in robot.joints.iter().enumerate() {
            joints_to_link[joint.child] = joints_to_link[joint.parent].clone();
            joints_to_link[joint.child].push(index);
        }
        let chains = robot
            .end_effectors
            .iter()
            .map(|ee| Chain {
                dofs: (0..JOINTS)
                    .chain(joints_to_link[ee.link].iter().map(|&j| JOINTS + j))
                    .collect(),
            })
            .collect();
        let carried = carried(robot, &joints_to_link);
        let mut model = Self {
            robot: robot.clone(),
            total_mass_kg: robot.links.iter().map(|l| l.mass_kg).sum(),
            centroidal_inertia_kg_m2: Matrix3::zeros(),
            nominal_q: DVector::zeros(JOINTS + robot.joints.len()),
            joints_to_link,
            chains,
            carried,
        };
        let nominal_rad: Vec<f64> = robot.joints.iter().map(|joint| joint.nominal_rad).collect();
        model.nominal_q = model.standing_q(&nominal_rad);
        model.centroidal_inertia_kg_m2 = model.inertia_about_com(&model.nominal_q);
        model
    }

    /// The robot.
    pub fn robot(&self) -> &Robot {
        &self.robot
    }

    /// Length of `q`: 6 + N.
    pub fn dofs(&self) -> usize {
        JOINTS + self.robot.joints.len()
    }

    /// Total mass M, kg.
    pub fn total_mass_kg(&self) -> f64 {
        self.total_mass_kg
    }

    /// Inertia I about the centre of mass, in body axes, at the nominal pose, kg·m². Taken as constant
    /// along a motion: the thesis's centroidal model.
    pub fn centroidal_inertia_kg_m2(&self) -> &Matrix3<f64> {
        &self.centroidal_inertia_kg_m2
    }

    /// Nominal configuration: nominal joint angles, level body above the world origin, lowest end
    /// effector touching the ground.
    pub fn nominal_q(&self) -> &DVector<f64> {
        &self.nominal_q
    }

    /// The robot standing with these joint angles, rad: level body above the world origin, lowest end
    /// effector touching the ground.
    pub fn standing_q(&self, joint_rad: &[f64]) -> DVector<f64> {
        let mut q = DVector::zeros(self.dofs());
        q.rows_mut(JOINTS, joint_rad.len()).copy_from_slice(joint_rad);
        let pose = self.pose(&q);
        let lowest = self
            .robot
            .end_effectors
            .iter()
            .zip(&pose.end_effectors)
            .map(|(ee, at)| at.center.z - drop_to_contact(at.axis, ee.radius_m))
            .fold(f64::INFINITY, f64::min);
        q[BASE_POSITION + 2] = -lowest;
        q
    }

    /// Degrees of freedom that move end effector `index`.
    pub fn chain(&self, index: usize) -> &Chain {
        &self.chains[index]
    }

    /// What joint `index` carries.
    pub fn carried(&self, index: usize) -> &Carried {
        &self.carried[index]
    }

    /// Wheel axis in the mounting link, `None` for a foot.
    pub fn wheel_axis_in_link(&self, index: usize) -> Option<Vector3<f64>> {
        self.robot.end_effectors[index].contact.axis_in_link().copied()
    }

    /// Forward kinematics with derivatives at `q`.
    pub fn pose(&self, q: &DVector<f64>) -> Pose {
        let base_origin = Vector3::new(q[0], q[1], q[2]);
        let ypr = Vector3::new(q[BASE_YAW], q[BASE_YAW + 1], q[BASE_YAW + 2]);
        let base_axes = rotation::yaw_pitch_roll_axes(&ypr);
        let LinkFrames { rotations, origins, axes } = self.link_frames(q);

        // Mass and first moment of everything that each joint carries, leaves first.
        let links = &self.robot.links;
        let mut moment: Vec<Vector3<f64>> = (0..links.len())
            .map(|l| (origins[l] + rotations[l] * links[l].com_in_link_m) * links[l].mass_kg)
            .collect();
        for joint in self.robot.joints.iter().rev() {
            let carried = moment[joint.child];
            moment[joint.parent] += carried;
        }
        let com = moment[0] / self.total_mass_kg;
        let mut d_com = Vec::with_capacity(self.dofs());
        d_com.extend([Vector3::x(), Vector3::y(), Vector3::z()]);
        d_com.extend(base_axes.iter().map(|w| w.cross(&(com - base_origin))));
        for (j, joint) in self.robot.joints.iter().enumerate() {
            let mass_kg = self.carried[j].mass_kg;
            let lever = moment[joint.child] - origins[joint.child] * mass_kg;
            d_com.push(axes[j].cross(&lever) / self.total_mass_kg);
        }

        let end_effectors = self
            .robot
            .end_effectors
            .iter()
            .enumerate()
            .map(|(index, ee)| {
                let world_from_link = rotations[ee.link];
                let center = origins[ee.link] + world_from_link * ee.center_in_link_m;
                let axis =
                    world_from_link * self.wheel_axis_in_link(index).unwrap_or_else(Vector3::zeros);
                let mut d_center = vec![Vector3::x(), Vector3::y(), Vector3::z()];
                let mut d_rotation = vec![Vector3::zeros(); 3];
                for w in &base_axes {
                    d_center.push(w.cross(&(center - base_origin)));
                    d_rotation.push(*w);
                }
                for &j in &self.joints_to_link[ee.link] {
                    d_center.push(axes[j].cross(&(center - origins[self.robot.joints[j].child])));
                    d_rotation.push(axes[j]);
                }
                let d_axis = d_rotation.iter().map(|w| w.cross(&axis)).collect();
                EndEffectorPose { center, d_center, axis, d_axis, world_from_link, d_rotation }
            })
            .collect();
        Pose {
            world_from_body: rotations[0],
            base_axes,
            com,
            d_com,
            end_effectors,
            link_origins: origins,
            joint_axes: axes,
            carried_moment: moment,
        }
    }

    fn link_frames(&self, q: &DVector<f64>) -> LinkFrames {
        let ypr = Vector3::new(q[BASE_YAW], q[BASE_YAW + 1], q[BASE_YAW + 2]);
        let mut rotations = vec![Matrix3::identity(); self.robot.links.len()];
        let mut origins = vec![Vector3::zeros(); self.robot.links.len()];
        let mut axes = Vec::with_capacity(self.robot.joints.len());
        rotations[0] = rotation::from_yaw_pitch_roll(&ypr);
        origins[0] = Vector3::new(q[0], q[1], q[2]);
        for (j, joint) in self.robot.joints.iter().enumerate() {
            let offset = joint.parent_from_joint.translation.vector;
            let world_from_joint = rotations[joint.parent]
                * joint.parent_from_joint.rotation.to_rotation_matrix().into_inner();
            origins[joint.child] = origins[joint.parent] + rotations[joint.parent] * offset;
            let axis = nalgebra::Unit::new_unchecked(joint.axis_in_joint);
            let turn = nalgebra::Rotation3::from_axis_angle(&axis, q[JOINTS + j]);
            rotations[joint.child] = world_from_joint * turn.into_inner();
            axes.push(world_from_joint * joint.axis_in_joint);
        }
        LinkFrames { rotations, origins, axes }
    }

    /// Inertia of the whole robot about its centre of mass, in body axes, kg·m².
    fn inertia_about_com(&self, q: &DVector<f64>) -> Matrix3<f64> {
        let com = self.pose(q).com;
        let LinkFrames { rotations, origins, .. } = self.link_frames(q);
        let mut inertia = Matrix3::zeros();
        for (l, link) in self.robot.links.iter().enumerate() {
            let arm = rotation::skew(&(origins[l] + rotations[l] * link.com_in_link_m - com));
            inertia += rotations[l] * link.inertia_in_link_kg_m2 * rotations[l].transpose()
                - arm * arm * link.mass_kg;
        }
        rotations[0].transpose() * inertia * rotations[0]
    }
}

/// What every joint carries.
fn carried(robot: &Robot, joints_to_link: &[Vec<usize>]) -> Vec<Carried> {
    let moves = |joint: usize, link: usize| joints_to_link[link].contains(&joint);
    let joints = 0..robot.joints.len();
    let of = |joint: usize| {
        let path = &joints_to_link[robot.joints[joint].child];
        let beyond = |link: &usize| moves(joint, *link);
        Carried {
            mass_kg: (0..robot.links.len())
                .filter(beyond)
                .map(|link| robot.links[link].mass_kg)
                .sum(),
            above: path[..path.len() - 1].to_vec(),
            below: joints
                .clone()
                .filter(|&k| k != joint && moves(joint, robot.joints[k].child))
                .collect(),
            end_effectors: (0..robot.end_effectors.len())
                .filter(|&e| moves(joint, robot.end_effectors[e].link))
                .collect(),
        }
    };
    joints.clone().map(of).collect()
}

/// Height of the wheel centre above its lowest point, m: r·sin of the axis's angle to the vertical;
/// a foot (zero axis) is a sphere.
fn drop_to_contact(axis: Vector3<f64>, radius_m: f64) -> f64 {
    radius_m * (1.0 - axis.z * axis.z).max(0.0).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_robots;

    #[test]
    fn jacobians_match_finite_differences_at_random_poses() {
        let step = 1e-6; // central differences: error about step² + 1e-16/step = 1e-10
        for robot in test_robots::all() {
            let model = Model::new(&robot);
            for seed in 0..5 {
                let q = test_robots::random_q(&model, seed);
                let pose = model.pose(&q);
                for k in 0..model.dofs() {
                    let (mut plus, mut minus) = (q.clone(), q.clone());
                    plus[k] += step;
                    minus[k] -= step;
                    let (plus, minus) = (model.pose(&plus), model.pose(&minus));
                    let com = (plus.com - minus.com) / (2.0 * step);
                    assert!((com - pose.d_com[k]).norm() < 1e-8, "{} com {k}", robot.name);
                    for (index, at) in pose.end_effectors.iter().enumerate() {
                        let (p, m) = (&plus.end_effectors[index], &minus.end_effectors[index]);
                        let column = model.chain(index).dofs.iter().position(|&d| d == k);
                        let zero = Vector3::zeros();
                        let (d_center, d_axis) =
                            column.map_or((zero, zero), |c| (at.d_center[c], at.d_axis[c]));
                        let center = (p.center - m.center) / (2.0 * step);
                        let axis = (p.axis - m.axis) / (2.0 * step);
                        assert!((center - d_center).norm() < 1e-8, "{} center", robot.name);
                        assert!((axis - d_axis).norm() < 1e-8, "{} axis", robot.name);
                    }
                }
            }
        }
    }

    #[test]
    fn nominal_pose_touches_the_ground_and_is_not_below_it() {
        for robot in test_robots::all() {
            let model = Model::new(&robot);
            let pose = model.pose(model.nominal_q());
            let lowest = robot
                .end_effectors
                .iter()
                .zip(&pose.end_effectors)
                .map(|(ee, at)| at.center.z - drop_to_contact(at.axis, ee.radius_m))
                .fold(f64::INFINITY, f64::min);
            assert!(lowest.abs() < 1e-12, "{}: {lowest}", robot.name); // rounding only
        }
    }
}
