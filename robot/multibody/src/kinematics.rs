//! Velocities and accelerations of all links, from the base outwards.
//!
//! For a joint with axis a between parent p and child c, where d is the vector from the parent's origin to the child's:
//!
//! ```text
//! ω_c = ω_p + a q̇              v_c = v_p + ω_p × d
//! α_c = α_p + a q̈ + ω_p × a q̇   a_c = a_p + α_p × d + ω_p × (ω_p × d)
//! ```
//!
//! A prismatic joint, whose child moves by s q̇ relative to the parent, does not turn (a = 0). It adds s q̇ to v_c, and
//! s q̈ + 2 ω_p × s q̇ to a_c.
//!
//! These are RBDA Eqs. 5.7 and 5.8, with the acceleration of the link's origin instead of spatial acceleration. With ν̇ = 0,
//! each acceleration is a bias acceleration J̇ν, since a = J ν̇ + J̇ ν.

use crate::{ANGULAR, Configuration, Frames, JOINTS, LINEAR, Tree};
use nalgebra::Vector3;

/// Velocities and accelerations of all links at one configuration, in world axes.
#[derive(Clone, Debug)]
pub struct Kinematics {
    /// Poses of the links.
    pub frames: Frames,
    /// Angular velocity of every link, rad/s.
    pub angular_velocity: Vec<Vector3<f64>>,
    /// Velocity of the origin of every link, m/s.
    pub linear_velocity: Vec<Vector3<f64>>,
    /// Angular acceleration of every link, rad/s².
    pub angular_acceleration: Vec<Vector3<f64>>,
    /// Acceleration of the origin of every link, m/s².
    pub linear_acceleration: Vec<Vector3<f64>>,
    pub(crate) joint_rad: Vec<f64>,
    pub(crate) velocity: Vec<f64>,
    pub(crate) acceleration: Vec<f64>,
}

impl Kinematics {
    /// State at rest in a configuration.
    ///
    /// # Panics
    /// If the configuration has fewer angles than the robot has joints.
    pub fn new(tree: &Tree, at: &Configuration) -> Self {
        let zeros = vec![Vector3::zeros(); tree.robot().links.len()];
        Self {
            frames: Frames::new(tree, at),
            angular_velocity: zeros.clone(),
            linear_velocity: zeros.clone(),
            angular_acceleration: zeros.clone(),
            linear_acceleration: zeros,
            joint_rad: at.joint_rad[..tree.robot().joints.len()].to_vec(),
            velocity: vec![0.0; tree.dofs()],
            acceleration: vec![0.0; tree.dofs()],
        }
    }

    /// Updates configuration and velocity ν, with zero acceleration ν̇. The accelerations are then bias accelerations J̇ν.
    ///
    /// # Panics
    /// If the configuration has fewer angles than the robot has joints, or the length of `velocity` is not [`Tree::dofs`].
    pub fn update(&mut self, tree: &Tree, at: &Configuration, velocity: &[f64]) {
        self.frames.update(tree, at);
        self.joint_rad.copy_from_slice(&at.joint_rad[..tree.robot().joints.len()]);
        self.velocity.copy_from_slice(velocity);
        self.angular_velocity[0] = triple(velocity, ANGULAR);
        self.linear_velocity[0] = triple(velocity, LINEAR);
        for (j, joint) in tree.robot().joints.iter().enumerate() {
            let (p, c) = (joint.parent, joint.child);
            let d = self.frames.link_origins[c] - self.frames.link_origins[p];
            let w = self.angular_velocity[p];
            self.angular_velocity[c] = w + self.frames.joint_axes[j] * velocity[JOINTS + j];
            self.linear_velocity[c] = self.linear_velocity[p] + w.cross(&d);
            if let Some(slide) = &self.frames.joint_slides[j] {
                self.linear_velocity[c] += slide * velocity[JOINTS + j];
            }
        }
        self.acceleration.fill(0.0);
        self.propagate_accelerations(tree);
    }

    /// Sets the acceleration ν̇ at the present configuration and velocity.
    ///
    /// # Panics
    /// If the length of `acceleration` is not [`Tree::dofs`].
    pub fn accelerate(&mut self, tree: &Tree, acceleration: &[f64]) {
        self.acceleration.copy_from_slice(acceleration);
        self.propagate_accelerations(tree);
    }

    fn propagate_accelerations(&mut self, tree: &Tree) {
        self.angular_acceleration[0] = triple(&self.acceleration, ANGULAR);
        self.linear_acceleration[0] = triple(&self.acceleration, LINEAR);
        for (j, joint) in tree.robot().joints.iter().enumerate() {
            let (p, c) = (joint.parent, joint.child);
            let d = self.frames.link_origins[c] - self.frames.link_origins[p];
            let (w, alpha) = (self.angular_velocity[p], self.angular_acceleration[p]);
            let axis = self.frames.joint_axes[j];
            self.angular_acceleration[c] = alpha
                + axis * self.acceleration[JOINTS + j]
                + w.cross(&axis) * self.velocity[JOINTS + j];
            self.linear_acceleration[c] =
                self.linear_acceleration[p] + alpha.cross(&d) + w.cross(&w.cross(&d));
            if let Some(slide) = &self.frames.joint_slides[j] {
                let coriolis = w.cross(slide) * (2.0 * self.velocity[JOINTS + j]);
                self.linear_acceleration[c] += slide * self.acceleration[JOINTS + j] + coriolis;
            }
        }
    }

    /// Velocity of a point of a link, m/s. The point is in world axes.
    pub fn point_velocity(&self, link: usize, point: &Vector3<f64>) -> Vector3<f64> {
        let arm = point - self.frames.link_origins[link];
        self.linear_velocity[link] + self.angular_velocity[link].cross(&arm)
    }

    /// Acceleration of a point of a link, m/s²; J̇ν of the point while ν̇ = 0. The point is in world axes.
    pub fn point_acceleration(&self, link: usize, point: &Vector3<f64>) -> Vector3<f64> {
        let arm = point - self.frames.link_origins[link];
        let w = self.angular_velocity[link];
        self.linear_acceleration[link]
            + self.angular_acceleration[link].cross(&arm)
            + w.cross(&w.cross(&arm))
    }

    /// Velocity of the robot's centre of mass, m/s.
    pub fn com_velocity(&self, tree: &Tree) -> Vector3<f64> {
        self.mass_mean(tree, |link, com| self.point_velocity(link, com))
    }

    /// Acceleration of the robot's centre of mass, m/s²; J̇ν of the centre of mass while ν̇ = 0.
    pub fn com_acceleration(&self, tree: &Tree) -> Vector3<f64> {
        self.mass_mean(tree, |link, com| self.point_acceleration(link, com))
    }

    fn mass_mean(
        &self,
        tree: &Tree,
        of: impl Fn(usize, &Vector3<f64>) -> Vector3<f64>,
    ) -> Vector3<f64> {
        let links = tree.robot().links.iter().enumerate();
        let sum: Vector3<f64> =
            links.map(|(l, link)| of(l, &self.frames.link_com(tree, l)) * link.mass_kg).sum();
        sum / tree.total_mass_kg()
    }
}

/// Three consecutive entries as a vector.
fn triple(values: &[f64], first: usize) -> Vector3<f64> {
    Vector3::from_column_slice(&values[first..first + 3])
}
