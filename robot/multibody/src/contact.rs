//! Contact points of wheels, blades and feet with a plane: position, velocities, Jacobians.
//!
//! With the axis a, the plane's normal n and the radius r, the lowest point of the rim is ρ from the centre
//! (Eq. 2.2 of the thesis for any axis; a foot, a sphere, is the case a = 0):
//!
//! ```text
//! g = n − (a·n) a        ρ = −r g / |g|
//! ```
//!
//! Two points pass through c + ρ. The **material** point belongs to the tyre: its velocity
//! v_c + (Ω + a s) × ρ, with the spin s, is zero in rolling without slip. The **geometric** point stays the
//! lowest one: it moves over the tyre with v_c + ρ̇, and along the ground. Along the normal they agree.

use crate::ground::ElevationMap;
use crate::{ANGULAR, Frames, JOINTS, Kinematics, Tree};
use nalgebra::{Matrix3xX, Vector3};

/// Smallest |g|, the sine of the angle between axis and normal, at which the lowest point is defined.
const SMALLEST_SINE: f64 = 1e-6;

/// Rounds in which the contact point is found on ground that is not level.
const ROUNDS: usize = 8;

/// The point of an end effector that is nearest to a plane below it, or deepest in it.
///
/// The blade of a skate counts as a rim with its radius of curvature, without ends
/// (`EndEffector::blade` has its reach).
#[derive(Clone, Copy, Debug)]
pub struct RimContact {
    /// Index of the end effector.
    pub end_effector: usize,
    /// Index of the link that carries it.
    pub link: usize,
    /// Wheel centre or centre of the sphere in world, m.
    pub center: Vector3<f64>,
    /// Unit axis a in world; zero for a foot.
    pub axis: Vector3<f64>,
    /// Vector from the centre to the contact point, ρ in world, m.
    pub lever: Vector3<f64>,
    /// Index in ν of the spin; `None` for what does not spin.
    pub wheel_dof: Option<usize>,
    normal: Vector3<f64>,
    sine: f64,
}

/// Motion of the two points at a contact, in world.
#[derive(Clone, Copy, Debug)]
pub struct ContactMotion {
    /// Velocity of the material point, m/s: zero without slip.
    pub material_velocity: Vector3<f64>,
    /// Velocity of the geometric contact point, m/s.
    pub geometric_velocity: Vector3<f64>,
    /// Acceleration of the material point, m/s²: of a rolling wheel, s² r towards the centre.
    pub material_acceleration: Vector3<f64>,
    /// Rate of change of the material velocity **at the geometric point**, m/s²: zero in steady rolling. The
    /// constraint of rolling is this one, J ν̇ + J̇ ν = 0; it is J̇ ν while ν̇ = 0.
    pub rolling_acceleration: Vector3<f64>,
}

impl RimContact {
    /// Contact of an end effector with a plane of unit normal `normal` (world, away from the ground).
    /// `None` if the wheel lies flat on the plane, where no point is lowest.
    pub fn new(
        tree: &Tree,
        frames: &Frames,
        end_effector: usize,
        normal: &Vector3<f64>,
    ) -> Option<Self> {
        let ee = &tree.robot().end_effectors[end_effector];
        let axis_in_link = ee.contact.axis_in_link().copied().unwrap_or_else(Vector3::zeros);
        let axis = frames.world_from_link[ee.link] * axis_in_link;
        let upward = normal - axis * axis.dot(normal);
        let sine = upward.norm();
        (sine > SMALLEST_SINE).then(|| Self {
            end_effector,
            link: ee.link,
            center: frames.point(ee.link, &ee.center_in_link_m),
            axis,
            lever: upward * (-ee.radius_m / sine),
            wheel_dof: tree.wheel_dof(end_effector),
            normal: *normal,
            sine,
        })
    }

    /// Contact of an end effector with ground, along the normal that the ground has at the contact point: a fixed point, as
    /// long as the ground bends less than the rim. `None` as in [`new`](Self::new).
    pub fn on(
        tree: &Tree,
        frames: &Frames,
        end_effector: usize,
        ground: &ElevationMap,
    ) -> Option<Self> {
        let mut contact = Self::new(tree, frames, end_effector, &Vector3::z())?;
        let rounds = if ground.is_level() { 0 } else { ROUNDS };
        for _ in 0..rounds {
            let normal = ground.at(&contact.position()).normal();
            contact = Self::new(tree, frames, end_effector, &normal)?;
        }
        Some(contact)
    }

    /// Unit normal of the plane, away from the ground.
    pub fn normal(&self) -> &Vector3<f64> {
        &self.normal
    }

    /// The contact point in world, m.
    pub fn position(&self) -> Vector3<f64> {
        self.center + self.lever
    }

    /// Jacobian of the material point's velocity, 3 × [`Tree::dofs`].
    pub fn material_jacobian(&self, tree: &Tree, frames: &Frames, out: &mut Matrix3xX<f64>) {
        frames.point_jacobian(tree, self.link, &self.position(), out);
        if let Some(dof) = self.wheel_dof {
            out.set_column(dof, &self.axis.cross(&self.lever));
        }
    }

    /// Jacobian of the geometric contact point's velocity, 3 × [`Tree::dofs`]; spin does not move it.
    pub fn geometric_jacobian(&self, tree: &Tree, frames: &Frames, out: &mut Matrix3xX<f64>) {
        frames.point_jacobian(tree, self.link, &self.center, out);
        let mut add = |dof: usize, turn: &Vector3<f64>| {
            let mut column = out.column_mut(dof);
            column += self.d_lever(&turn.cross(&self.axis));
        };
        for k in 0..3 {
            add(ANGULAR + k, &Vector3::ith(k, 1.0));
        }
        for &j in tree.joints_to_link(self.link) {
            add(JOINTS + j, &frames.joint_axes[j]);
        }
    }

    /// Time derivative of [`Self::material_jacobian`] taken at a point that moves with `point_velocity`:
    /// the material velocity gives that of a point fixed to the tyre, the geometric velocity that of the
    /// rolling constraint.
    pub fn material_jacobian_derivative(
        &self,
        tree: &Tree,
        kinematics: &Kinematics,
        point_velocity: &Vector3<f64>,
        out: &mut Matrix3xX<f64>,
    ) {
        let position = self.position();
        kinematics.point_jacobian_derivative(tree, self.link, &position, point_velocity, out);
        if let Some(dof) = self.wheel_dof {
            let d_axis = kinematics.angular_velocity[self.link].cross(&self.axis);
            let center_velocity = kinematics.point_velocity(self.link, &self.center);
            let d_lever = point_velocity - center_velocity;
            out.set_column(dof, &(d_axis.cross(&self.lever) + self.axis.cross(&d_lever)));
        }
    }

    /// Velocities and accelerations at the contact.
    pub fn motion(&self, kinematics: &Kinematics) -> ContactMotion {
        let link = self.link;
        let carrier = kinematics.angular_velocity[link];
        let d_axis = carrier.cross(&self.axis);
        let (mut w, mut alpha) = (carrier, kinematics.angular_acceleration[link]);
        if let Some(dof) = self.wheel_dof {
            let speed = kinematics.velocity[dof];
            w += self.axis * speed;
            alpha += self.axis * kinematics.acceleration[dof] + d_axis * speed;
        }
        let center_velocity = kinematics.point_velocity(link, &self.center);
        let center_acceleration = kinematics.point_acceleration(link, &self.center);
        let turned = w.cross(&self.lever);
        let d_lever = self.d_lever(&d_axis);
        let common = center_acceleration + alpha.cross(&self.lever);
        ContactMotion {
            material_velocity: center_velocity + turned,
            geometric_velocity: center_velocity + d_lever,
            material_acceleration: common + w.cross(&turned),
            rolling_acceleration: common + w.cross(&d_lever),
        }
    }

    /// Change of ρ for a change of the axis: with u = −ρ/r, dρ = −r/|g| (1 − u uᵀ) dg.
    fn d_lever(&self, d_axis: &Vector3<f64>) -> Vector3<f64> {
        let radius = self.lever.norm();
        let upward = -self.lever / radius;
        let d_upward = -self.axis * d_axis.dot(&self.normal) - d_axis * self.axis.dot(&self.normal);
        (d_upward - upward * upward.dot(&d_upward)) * (-radius / self.sine)
    }
}
