//! Spring between a point of a body and a point of the world, such as a bolt in a wall or a moving handle.

use crate::force::{Derivative, Force, StateBlock, View, Wrench};
use crate::motion::BodyMotion;
use nalgebra::{Matrix3, Vector3};
use rollwalk_multibody::rotation::skew;

/// Point of a body, point of the world, and the spring between them.
#[derive(Clone, Debug, PartialEq)]
pub struct Anchor {
    /// Index of the body.
    pub body: [usize; 1],
    /// Point of the body, from its centre of mass in body axes, m; 0 for a particle.
    pub point: Vector3<f64>,
    /// Point of the world, in world axes, m.
    pub place: Vector3<f64>,
    /// Stiffness, N/m.
    pub stiffness_n_m: f64,
    /// Damping of the point's velocity, N·s/m.
    pub damping_n_s_m: f64,
}

impl Anchor {
    /// Force on the body, N, and the arm from the centre of mass to the point, m.
    fn force(&self, now: &BodyMotion) -> (Vector3<f64>, Vector3<f64>) {
        let (place, velocity) = now.point(&self.point);
        let force = (self.place - place) * self.stiffness_n_m - velocity * self.damping_n_s_m;
        (force, now.rotation * self.point)
    }
}

impl Force for Anchor {
    fn bodies(&self) -> &[usize] {
        &self.body
    }

    fn wrenches(&self, view: &View<'_>, wrenches: &mut [Wrench]) {
        let (force, arm) = self.force(&view.now[0]);
        wrenches[0].force += force;
        wrenches[0].moment += arm.cross(&force);
    }

    fn derivatives(
        &self,
        view: &View<'_>,
        wrenches: &mut [Wrench],
        derivatives: &mut [Derivative],
    ) {
        self.wrenches(view, wrenches);
        let (force, arm) = self.force(&view.now[0]);
        let lever = skew(&arm);
        // δ(ω × ρ) = [ω] δρ with δρ = −[ρ] δθ.
        let spin = skew(&view.now[0].spin);
        let one = Matrix3::identity();
        for (by, block) in [
            (StateBlock::Position, one * -self.stiffness_n_m),
            (StateBlock::Rotation, lever * self.stiffness_n_m + spin * lever * self.damping_n_s_m),
            (StateBlock::Velocity, one * -self.damping_n_s_m),
            (StateBlock::Spin, lever * self.damping_n_s_m),
        ] {
            derivatives[0].add_force(by, &block);
            derivatives[0].add_moment(by, &(lever * block));
        }
        derivatives[0].add_moment(StateBlock::Rotation, &(skew(&force) * lever));
    }

    fn energy(&self, now: &[BodyMotion]) -> f64 {
        let (place, _) = now[0].point(&self.point);
        0.5 * self.stiffness_n_m * (self.place - place).norm_squared()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::check::agrees_with_finite_differences;

    #[test]
    fn an_anchor_has_its_derivatives() {
        agrees_with_finite_differences(&Anchor {
            body: [0],
            point: Vector3::new(0.1, -0.2, 0.05),
            place: Vector3::new(0.0, 0.3, 0.1),
            stiffness_n_m: 50.0,
            damping_n_s_m: 3.0,
        });
    }
}
