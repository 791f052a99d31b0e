//! Forward kinematics of the tree: poses of all links, joint axes, first moments, centre of mass.

use crate::Tree;
use crate::rotation::skew;
use nalgebra::{Matrix3, Rotation3, Unit, Vector3};
use rollwalk_robot::Ratios;

/// Pose of the base, and joint angles. Wheel angles are absent, because wheels are symmetric about their axes.
#[derive(Clone, Copy, Debug)]
pub struct Configuration<'a> {
    /// Origin of the root link in world axes, m.
    pub base_position_m: Vector3<f64>,
    /// World-from-body rotation.
    pub world_from_body: Matrix3<f64>,
    /// Joint angles in joint order, rad.
    pub joint_rad: &'a [f64],
}

/// Frames of all links at one configuration, in world axes.
#[derive(Clone, Debug)]
pub struct Frames {
    /// World-from-link rotation of every link.
    pub world_from_link: Vec<Matrix3<f64>>,
    /// Origin of each link frame, m. The origin of a joint is the origin of its child.
    pub link_origins: Vec<Vector3<f64>>,
    /// Angular velocity of the child of each joint per unit of joint speed: the axis, or 0 for a prismatic joint.
    pub joint_axes: Vec<Vector3<f64>>,
    /// Velocity of the child of each prismatic joint per unit of joint speed, m/rad; `None` for revolute joints.
    pub joint_slides: Vec<Option<Vector3<f64>>>,
    /// Ratios of the motors in this pose; `None` if they are constant.
    ratios: Option<Ratios>,
    /// First moment Σ m x of each link with all links that it carries, kg·m.
    pub carried_moments: Vec<Vector3<f64>>,
}

impl Frames {
    /// Computes the frames of a robot at a configuration.
    ///
    /// # Panics
    /// If the configuration has fewer angles than the robot has joints.
    pub fn new(tree: &Tree, at: &Configuration) -> Self {
        let links = tree.robot().links.len();
        let mut frames = Self {
            world_from_link: vec![Matrix3::identity(); links],
            link_origins: vec![Vector3::zeros(); links],
            joint_axes: vec![Vector3::zeros(); tree.robot().joints.len()],
            joint_slides: vec![None; tree.robot().joints.len()],
            ratios: None,
            carried_moments: vec![Vector3::zeros(); links],
        };
        frames.update(tree, at);
        frames
    }

    /// Updates the frames for another configuration, without allocation (RBDA sec. 4.1.3, Eq. 2.14 of the thesis).
    ///
    /// # Panics
    /// If the configuration has fewer angles than the robot has joints.
    pub fn update(&mut self, tree: &Tree, at: &Configuration) {
        let robot = tree.robot();
        let (rotations, origins) = (&mut self.world_from_link, &mut self.link_origins);
        rotations[0] = at.world_from_body;
        origins[0] = at.base_position_m;
        for (j, joint) in robot.joints.iter().enumerate() {
            let offset = joint.parent_from_joint.translation.vector;
            let world_from_joint = rotations[joint.parent] * tree.parent_from_joint(j);
            origins[joint.child] = origins[joint.parent] + rotations[joint.parent] * offset;
            if let Some(travel_m_per_rad) = joint.travel_m_per_rad {
                let slide = world_from_joint * joint.axis_in_joint * travel_m_per_rad;
                origins[joint.child] += slide * at.joint_rad[j];
                rotations[joint.child] = world_from_joint;
                self.joint_slides[j] = Some(slide);
                continue;
            }
            let axis = Unit::new_unchecked(joint.axis_in_joint);
            let turn = Rotation3::from_axis_angle(&axis, at.joint_rad[j]);
            rotations[joint.child] = world_from_joint * turn.into_inner();
            self.joint_axes[j] = world_from_joint * joint.axis_in_joint;
        }
        if tree.transmission().has_linkages() {
            self.ratios = Some(tree.transmission().at(at.joint_rad).into_owned());
        }
        // Leaves first.
        for l in 0..robot.links.len() {
            self.carried_moments[l] = self.link_com(tree, l) * robot.links[l].mass_kg;
        }
        for joint in robot.joints.iter().rev() {
            let carried = self.carried_moments[joint.child];
            self.carried_moments[joint.parent] += carried;
        }
    }

    /// Ratios of the motors in this pose.
    pub fn ratios<'f>(&'f self, tree: &'f Tree) -> &'f Ratios {
        self.ratios.as_ref().unwrap_or_else(|| tree.transmission().nominal())
    }

    /// Displacement per radian of a joint, m/rad, of a point that the joint carries. `arm` leads from the origin of the joint's
    /// child to the point.
    pub fn joint_displacement(&self, joint: usize, arm: &Vector3<f64>) -> Vector3<f64> {
        match &self.joint_slides[joint] {
            Some(slide) => *slide,
            None => self.joint_axes[joint].cross(arm),
        }
    }

    /// Transforms a point from the frame of a link to world axes, m.
    pub fn point(&self, link: usize, point_in_link_m: &Vector3<f64>) -> Vector3<f64> {
        self.link_origins[link] + self.world_from_link[link] * point_in_link_m
    }

    /// Centre of mass of a link in world axes, m.
    pub fn link_com(&self, tree: &Tree, link: usize) -> Vector3<f64> {
        self.point(link, &tree.robot().links[link].com_in_link_m)
    }

    /// Inertia of a link about its centre of mass, in world axes, kg·m².
    pub fn link_inertia(&self, tree: &Tree, link: usize) -> Matrix3<f64> {
        let rotation = self.world_from_link[link];
        rotation * tree.robot().links[link].inertia_in_link_kg_m2 * rotation.transpose()
    }

    /// Centre of mass of the robot in world axes, m.
    pub fn com(&self, tree: &Tree) -> Vector3<f64> {
        self.carried_moments[0] / tree.total_mass_kg()
    }

    /// Inertia of the whole robot about its centre of mass, in world axes, kg·m²: angular momentum per angular velocity with
    /// locked joints.
    pub fn centroidal_inertia(&self, tree: &Tree) -> Matrix3<f64> {
        let com = self.com(tree);
        let mut inertia = Matrix3::zeros();
        for (l, link) in tree.robot().links.iter().enumerate() {
            let arm = skew(&(self.link_com(tree, l) - com));
            inertia += self.link_inertia(tree, l) - arm * arm * link.mass_kg;
        }
        inertia
    }
}
