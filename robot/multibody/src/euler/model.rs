//! Robot prepared for the optimiser: nominal pose, second moments of links, chains of degrees of freedom.

use super::{BASE_POSITION, BASE_YAW, JOINTS};
use crate::clearance::Clearance;
use crate::{Configuration, Frames, Tree, rotation};
use nalgebra::{DVector, Matrix3, Vector3};
use rollwalk_robot::{EndEffector, Link, Robot};

/// Robot prepared for the optimiser, computed once.
#[derive(Clone, Debug)]
pub struct Model {
    tree: Tree,
    second_moments_kg_m2: Vec<Matrix3<f64>>,
    nominal_q: DVector<f64>,
    chains: Vec<Chain>,
    carried: Vec<Subtree>,
    clearance: Clearance,
}

/// Configuration of the tree at `q`.
pub(super) fn configuration(q: &[f64]) -> Configuration<'_> {
    let ypr = Vector3::from_column_slice(&q[BASE_YAW..BASE_YAW + 3]);
    Configuration {
        base_position_m: Vector3::from_column_slice(&q[BASE_POSITION..BASE_POSITION + 3]),
        world_from_body: rotation::from_yaw_pitch_roll(&ypr),
        joint_rad: &q[JOINTS..],
    }
}

/// Subtree that a joint moves, and the joints that move it.
#[derive(Clone, Debug)]
pub struct Subtree {
    /// Mass of the links beyond the joint, kg.
    pub mass_kg: f64,
    /// Joints between the base and this joint, base first.
    pub above: Vec<usize>,
    /// Joints beyond this joint.
    pub below: Vec<usize>,
    /// End effectors beyond this joint.
    pub end_effectors: Vec<usize>,
}

/// Degrees of freedom that move an end effector: the six of the base, then the joints of its limb.
#[derive(Clone, Debug)]
pub struct Chain {
    /// Indices in `q`, ascending from the base.
    pub dofs: Vec<usize>,
}

impl Model {
    /// Prepares a robot for kinematics.
    pub fn new(robot: &Robot) -> Self {
        let tree = Tree::new(robot);
        let limbs = robot.end_effectors.iter().map(|ee| tree.joints_to_link(ee.link));
        let chain = |joints: &[usize]| Chain {
            dofs: (0..JOINTS).chain(joints.iter().map(|&j| JOINTS + j)).collect(),
        };
        let mut model = Self {
            second_moments_kg_m2: robot.links.iter().map(second_moment).collect(),
            nominal_q: DVector::zeros(JOINTS + robot.joints.len()),
            chains: limbs.map(chain).collect(),
            carried: carried(&tree),
            clearance: Clearance::default(),
            tree,
        };
        let nominal_rad: Vec<f64> = robot.joints.iter().map(|joint| joint.nominal_rad).collect();
        model.nominal_q = model.standing_q(&nominal_rad);
        model.clearance = Clearance::new(&model.tree, &model.frames(&model.nominal_q));
        model
    }

    /// Counts a further pose as valid, as the nominal one: shapes may be as near to each other and to the ground as in it.
    pub fn allowing(mut self, q: &DVector<f64>) -> Self {
        self.clearance.allow(&self.frames(q));
        self
    }

    /// Tree of the robot. Wheels turn with their links, and joints have no armature.
    pub fn tree(&self) -> &Tree {
        &self.tree
    }

    /// The robot.
    pub fn robot(&self) -> &Robot {
        self.tree.robot()
    }

    /// Length of `q`: 6 + N.
    pub fn dofs(&self) -> usize {
        self.tree.dofs()
    }

    /// Total mass M, kg.
    pub fn total_mass_kg(&self) -> f64 {
        self.tree.total_mass_kg()
    }

    /// Second moment Σ m x xᵀ of a link about its centre of mass, in link axes, kg·m².
    pub(super) fn second_moment(&self, link: usize) -> &Matrix3<f64> {
        &self.second_moments_kg_m2[link]
    }

    /// Nominal configuration: nominal joint angles, level body above the world origin, lowest end effector touching the ground.
    pub fn nominal_q(&self) -> &DVector<f64> {
        &self.nominal_q
    }

    /// Standing configuration for given joint angles, rad: level body above the world origin, lowest end effector touching the
    /// ground.
    pub fn standing_q(&self, joint_rad: &[f64]) -> DVector<f64> {
        let mut q = DVector::zeros(self.dofs());
        q.rows_mut(JOINTS, joint_rad.len()).copy_from_slice(joint_rad);
        let frames = self.frames(&q);
        let height_m = |(index, ee): (usize, &EndEffector)| {
            let axis_in_link = self.wheel_axis_in_link(index).unwrap_or_else(Vector3::zeros);
            let axis = frames.world_from_link[ee.link] * axis_in_link;
            frames.point(ee.link, &ee.center_in_link_m).z - drop_to_contact(axis, ee.radius_m)
        };
        let end_effectors = self.robot().end_effectors.iter().enumerate();
        let lowest = end_effectors.map(height_m).fold(f64::INFINITY, f64::min);
        q[BASE_POSITION + 2] = -lowest;
        q
    }

    /// Frames of all links at `q`.
    pub fn frames(&self, q: &DVector<f64>) -> Frames {
        Frames::new(self.tree(), &configuration(q.as_slice()))
    }

    /// Degrees of freedom that move end effector `index`.
    pub fn chain(&self, index: usize) -> &Chain {
        &self.chains[index]
    }

    /// Subtree beyond joint `index`.
    pub fn carried(&self, index: usize) -> &Subtree {
        &self.carried[index]
    }

    /// Shapes and points that must keep clear of each other and of the ground.
    pub fn clearance(&self) -> &Clearance {
        &self.clearance
    }

    /// Wheel axis in the mounting link; `None` for a foot.
    pub fn wheel_axis_in_link(&self, index: usize) -> Option<Vector3<f64>> {
        self.robot().end_effectors[index].contact.axis_in_link().copied()
    }
}

/// Second moment Σ m x xᵀ of a link about its centre of mass, in link axes, kg·m².
fn second_moment(link: &Link) -> Matrix3<f64> {
    let inertia = &link.inertia_in_link_kg_m2;
    Matrix3::from_diagonal_element(0.5 * inertia.trace()) - inertia
}

/// Height of the wheel centre above its lowest point, m: the radius times the sine of the angle between axis and vertical. A
/// foot, with axis zero, is a sphere.
fn drop_to_contact(axis: Vector3<f64>, radius_m: f64) -> f64 {
    radius_m * (1.0 - axis.z * axis.z).max(0.0).sqrt()
}

/// Subtree beyond each joint.
fn carried(tree: &Tree) -> Vec<Subtree> {
    let robot = tree.robot();
    let moves = |joint: usize, link: usize| tree.joints_to_link(link).contains(&joint);
    let joints = 0..robot.joints.len();
    let of = |joint: usize| {
        let path = tree.joints_to_link(robot.joints[joint].child);
        Subtree {
            mass_kg: tree.carried_mass_kg(joint),
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
