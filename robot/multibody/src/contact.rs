//! Contact points of wheels, blades and feet with a plane: position, velocities, Jacobians.
//!
//! With the axis a, the plane's normal n and the radius r, the vector from the centre to the lowest point of the rim is ρ. The
//! formula is Eq. 2.2 of the thesis for any axis; for a foot, which is a sphere, a = 0:
//!
//! ```text
//! g = n − (a·n) a        ρ = −r g / |g|
//! ```
//!
//! Two points pass through c + ρ. The **material** point belongs to the tyre. Its velocity v_c + (Ω + a s) × ρ, with the spin
//! s, is zero in rolling without slip. The **geometric** point remains the lowest point. It moves over the tyre and along the
//! ground with v_c + ρ̇. The normal components of both velocities are equal.

use crate::ground::ElevationMap;
use crate::{ANGULAR, Frames, JOINTS, Kinematics, Tree};
use nalgebra::{Matrix3, Matrix3xX, Vector3};

/// Smallest |g| for which the lowest point is defined: the sine of the angle between axis and normal.
const SMALLEST_SINE: f64 = 1e-6;

/// Contact point of an end effector: the point that is nearest to a plane below it, or deepest in it.
///
/// The blade of a skate counts as a rim with its radius of curvature and without ends. `EndEffector::blade` gives its reach.
#[derive(Clone, Copy, Debug)]
pub struct RimContact {
    /// Index of the end effector.
    pub end_effector: usize,
    /// Index of the link that carries the end effector.
    pub link: usize,
    /// Centre of the wheel or sphere in world axes, m.
    pub center: Vector3<f64>,
    /// Unit axis a in world axes; zero for a foot.
    pub axis: Vector3<f64>,
    /// Vector ρ from the centre to the contact point, in world axes, m.
    pub lever: Vector3<f64>,
    /// Index of the spin in ν; `None` for end effectors that do not spin.
    pub wheel_dof: Option<usize>,
    normal: Vector3<f64>,
    sine: f64,
}

/// Motion of the material and the geometric point at a contact, in world axes.
#[derive(Clone, Copy, Debug)]
pub struct ContactMotion {
    /// Velocity of the material point, m/s; zero without slip.
    pub material_velocity: Vector3<f64>,
    /// Velocity of the geometric contact point, m/s.
    pub geometric_velocity: Vector3<f64>,
    /// Acceleration of the material point, m/s². For a rolling wheel, s² r towards the centre.
    pub material_acceleration: Vector3<f64>,
    /// Rate of change of the material velocity **at the geometric point**, m/s². It is zero in steady rolling. The rolling
    /// constraint is J ν̇ + J̇ ν = 0; with ν̇ = 0 the value is J̇ ν.
    pub rolling_acceleration: Vector3<f64>,
}

impl RimContact {
    /// Contact of an end effector with a plane. `normal` is the unit normal in world axes, away from the ground. `None` if the
    /// wheel lies flat on the plane, so that it has no unique lowest point.
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

    /// Contact of an end effector with uneven ground, along the ground normal at the contact point. `None` if the wheel lies
    /// flat, as in [`new`](Self::new).
    pub fn on(
        tree: &Tree,
        frames: &Frames,
        end_effector: usize,
        ground: &ElevationMap,
    ) -> Option<Self> {
        let level = Self::new(tree, frames, end_effector, &Vector3::z())?;
        if ground.is_level() {
            return Some(level);
        }
        let (axis, radius_m) = (level.axis, tree.robot().end_effectors[end_effector].radius_m);
        let across = Matrix3::identity() - axis * axis.transpose();
        let normal = ground.normal_below(&level.center, |normal| {
            let upward = across * normal;
            let unit = upward.normalize();
            let by_upward = (Matrix3::identity() - unit * unit.transpose()) / upward.norm();
            (unit * -radius_m, by_upward * across * -radius_m)
        });
        Self::new(tree, frames, end_effector, &normal)
    }

    /// Unit normal of the plane, away from the ground.
    pub fn normal(&self) -> &Vector3<f64> {
        &self.normal
    }

    /// Contact point in world axes, m.
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

    /// Jacobian of the geometric contact point's velocity, 3 × [`Tree::dofs`]. The spin does not contribute.
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

    /// Time derivative of [`Self::material_jacobian`] at a point that moves with `point_velocity`. The material velocity gives
    /// the derivative for a point fixed to the tyre; the geometric velocity gives the one for the rolling constraint.
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

    /// Change of ρ for a change of the axis: dρ = −r/|g| (1 − u uᵀ) dg with u = −ρ/r.
    fn d_lever(&self, d_axis: &Vector3<f64>) -> Vector3<f64> {
        let radius = self.lever.norm();
        // The corner of a body that lies.
        if radius == 0.0 {
            return Vector3::zeros();
        }
        let upward = -self.lever / radius;
        let d_upward = -self.axis * d_axis.dot(&self.normal) - d_axis * self.axis.dot(&self.normal);
        (d_upward - upward * upward.dot(&d_upward)) * (-radius / self.sine)
    }
}
