//! Contact of a point of one body with the surface of another, whose shape is a signed distance in its own axes (thesis 4.5.3).
//! An example is a node of a cloth on a solid.

use crate::contact::Normal;
use crate::force::{Derivative, Force, Kink, StateBlock, StickingFriction, View, Wrench};
use crate::friction::Friction;
use crate::motion::BodyMotion;
use nalgebra::{Matrix3, Matrix6x3, Vector3};
use rollwalk_multibody::ground::{Ground, Surface};
use rollwalk_multibody::rotation::skew;
use std::sync::Arc;

/// Gap above which an iteration ignores a possible contact, m.
const REACH_M: f64 = 0.02;
/// Gap above which a step ignores a possible contact, m. The solver adds the distance that the bodies can move.
const FAR_M: f64 = 0.005;

/// Point of one body and solid of another.
#[derive(Clone, Debug)]
pub struct Collision {
    /// Body of the point, and body of the solid.
    pub bodies: [usize; 2],
    /// Point from the centre of mass of its body, in body axes, m; 0 for a particle.
    pub point: Vector3<f64>,
    /// Shape of the solid, in the axes of its body, from the centre of mass.
    pub solid: Arc<dyn Ground>,
    /// Law of the normal force.
    pub normal: Normal,
    /// Friction law. Hybrid friction acts as linear friction here, so that a sticking contact creeps.
    pub friction: Friction,
}

/// Contact geometry of the point for given motions of both bodies, in world axes.
#[derive(Clone, Copy, Debug)]
struct CollisionGeometry {
    surface: Surface,
    /// Vectors from the centres of mass to the point, m.
    arms: [Vector3<f64>; 2],
    /// Velocity of the point relative to the solid, m/s.
    velocity: Vector3<f64>,
}

/// Force on the point, and its derivatives with respect to position and velocity of the point relative to the solid.
struct Law {
    force: Vector3<f64>,
    by_place: Matrix3<f64>,
    by_velocity: Matrix3<f64>,
}

impl Collision {
    fn geometry(&self, now: &[BodyMotion]) -> CollisionGeometry {
        let (place, velocity) = now[0].point(&self.point);
        let arms = [now[0].rotation * self.point, place - now[1].position];
        let turn = now[1].rotation;
        let in_solid = self.solid.at(&(turn.transpose() * arms[1]));
        let surface = Surface {
            gap_m: in_solid.gap_m,
            gradient: turn * in_solid.gradient,
            normal: turn * in_solid.normal,
            curvature: turn * in_solid.curvature * turn.transpose(),
        };
        let velocity = velocity - now[1].velocity - now[1].spin.cross(&arms[1]);
        CollisionGeometry { surface, arms, velocity }
    }

    fn law(&self, surface: &Surface, velocity: &Vector3<f64>, tame: bool) -> Option<Law> {
        let Surface { gap_m, gradient, normal, curvature } = *surface;
        if gap_m >= 0.0 {
            return None;
        }
        let opening = normal.dot(velocity);
        let press = self.normal.press(gap_m, opening);
        let sliding = velocity - normal * opening;
        let mut friction = self.friction.force(&sliding, press.spring_n);
        if tame {
            friction = friction.secant(&sliding);
        }
        let opening_by_place = velocity.transpose() * curvature;
        let sliding_by_place = -(curvature * opening + normal * opening_by_place);
        let press_by_place =
            gradient.transpose() * press.by_gap + opening_by_place * press.by_opening;
        let across = Matrix3::identity() - normal * normal.transpose();
        Some(Law {
            force: normal * press.force_n + friction.force,
            by_place: normal * press_by_place
                + curvature * press.force_n
                + friction.by_sliding * sliding_by_place
                - friction.by_normal * gradient.transpose() * self.normal.stiffness_n_m,
            by_velocity: friction.by_sliding * across
                + normal * normal.transpose() * press.by_opening,
        })
    }

    fn add(spot: &CollisionGeometry, force: &Vector3<f64>, wrenches: &mut [Wrench]) {
        for (wrench, sign) in wrenches.iter_mut().zip([1.0, -1.0]) {
            wrench.force += force * sign;
        }
        wrenches[0].moment += spot.arms[0].cross(force);
        wrenches[1].moment -= spot.arms[1].cross(force);
    }
}

impl Force for Collision {
    fn bodies(&self) -> &[usize] {
        &self.bodies
    }

    fn wrenches(&self, view: &View<'_>, wrenches: &mut [Wrench]) {
        let spot = self.geometry(view.now);
        if let Some(law) = self.law(&spot.surface, &spot.velocity, false) {
            Self::add(&spot, &law.force, wrenches);
        }
    }

    fn derivatives(
        &self,
        view: &View<'_>,
        wrenches: &mut [Wrench],
        derivatives: &mut [Derivative],
    ) {
        const PARTS: [StateBlock; 4] =
            [StateBlock::Position, StateBlock::Rotation, StateBlock::Velocity, StateBlock::Spin];
        const ROTATION: usize = 1;
        let spot = self.geometry(view.now);
        let Some(law) = self.law(&spot.surface, &spot.velocity, view.tame) else { return };
        Self::add(&spot, &law.force, wrenches);
        let Law { force, by_place, by_velocity } = law;
        let levers = spot.arms.map(|arm| skew(&arm));
        let spins = [0, 1].map(|k| skew(&view.now[k].spin));
        let (one, none) = (Matrix3::identity(), Matrix3::zeros());
        // Derivatives of the point and its velocity for an observer on the solid, for whom a rotation with the solid changes
        // nothing.
        let of_point = [one, -levers[0], none, none];
        let of_solid = [-one, levers[1], none, none];
        let drift = spins[1];
        let velocity_of_point = [-drift, (drift - spins[0]) * levers[0], one, -levers[0]];
        let velocity_of_solid = [drift, skew(&spot.velocity), -one, levers[1]];
        // Derivatives of the arm from the solid's centre of mass, in the world.
        let arm_of = [of_point, [-one, none, none, none]];
        for j in 0..2 {
            let (place, velocity) = match j {
                0 => (of_point, velocity_of_point),
                _ => (of_solid, velocity_of_solid),
            };
            for (k, part) in PARTS.into_iter().enumerate() {
                let mut force_by = by_place * place[k] + by_velocity * velocity[k];
                if j == 1 && k == ROTATION {
                    force_by -= skew(&force);
                }
                derivatives[j].add_force(part, &force_by);
                derivatives[2 + j].add_force(part, &-force_by);
                let mut moment_by = levers[0] * force_by;
                if j == 0 && k == ROTATION && !view.tame {
                    // The arm turns: δρ × f = [f] [ρ] δθ.
                    moment_by += skew(&force) * levers[0];
                }
                derivatives[j].add_moment(part, &moment_by);
                let moment_by = skew(&force) * arm_of[j][k] - levers[1] * force_by;
                derivatives[2 + j].add_moment(part, &moment_by);
            }
        }
    }

    fn has_kink(&self) -> bool {
        true
    }

    fn kink(&self, now: &[BodyMotion], _: Option<StickingFriction>) -> Option<Kink<'_>> {
        let spot = self.geometry(now);
        if spot.surface.gap_m > REACH_M {
            return None;
        }
        let levers = [(1.0, spot.arms[0]), (-1.0, spot.arms[1])].map(|(sign, arm)| {
            let mut lever = Matrix6x3::zeros();
            lever.fixed_view_mut::<3, 3>(0, 0).copy_from(&(Matrix3::identity() * sign));
            lever.fixed_view_mut::<3, 3>(3, 0).copy_from(&(skew(&arm) * sign));
            lever
        });
        // The surface is assumed to be flat.
        let law = move |gain: f64, shift: &Vector3<f64>| {
            let normal = spot.surface.normal;
            let gap_m = spot.surface.gap_m + normal.dot(shift);
            let flat = Surface { gap_m, gradient: normal, normal, curvature: Matrix3::zeros() };
            let velocity = spot.velocity + shift * gain;
            match self.law(&flat, &velocity, false) {
                Some(law) => (law.force, law.by_place + law.by_velocity * gain),
                None => (Vector3::zeros(), Matrix3::zeros()),
            }
        };
        let always = spot.surface.gap_m < 0.0;
        Some(Kink { levers, directions: 3, always, law: Box::new(law) })
    }

    fn is_far(&self, now: &[BodyMotion], step_s: f64) -> bool {
        let spot = self.geometry(now);
        spot.surface.gap_m > FAR_M + 2.0 * step_s * spot.velocity.norm()
    }

    fn energy(&self, now: &[BodyMotion]) -> f64 {
        let gap = self.geometry(now).surface.gap_m.min(0.0);
        0.5 * self.normal.stiffness_n_m * gap * gap
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::check::agrees_at;
    use crate::friction::FrictionModel;
    use crate::{Assembly, Inertia, Settings, System};
    use rollwalk_multibody::ground::{Grid, Sphere};

    const BALL: Sphere = Sphere { center: Vector3::new(0.0, 0.02, 0.0), radius_m: 0.2 };

    fn collision(solid: Arc<dyn Ground>, model: FrictionModel) -> Collision {
        Collision {
            bodies: [0, 1],
            point: Vector3::new(0.02, -0.01, -0.1),
            solid,
            normal: Normal { stiffness_n_m: 200.0, damping_n_s_m: 3.0, ramp_m: 0.02, pulls: true },
            friction: Friction { model, coefficient: 0.7, stick_n_s_m: 5.0 },
        }
    }

    #[test]
    fn a_collision_has_its_derivatives() {
        let grid = Grid::of(&BALL, Vector3::repeat(-0.5), 0.05, [21; 3]).unwrap();
        for solid in [Arc::new(BALL) as Arc<dyn Ground>, Arc::new(grid)] {
            for (model, pulls) in [
                (FrictionModel::Linear, true),
                (FrictionModel::Tanh, true),
                (FrictionModel::Linear, false),
            ] {
                let mut force = collision(Arc::clone(&solid), model);
                force.normal.pulls = pulls;
                agrees_at(&force, 20, |now| {
                    // The point is 1 cm deep.
                    let (place, _) = now[0].point(&force.point);
                    let out = (place - now[1].position).normalize();
                    let center = now[1].position + now[1].rotation * BALL.center;
                    now[0].position += center + out * (0.95 * BALL.radius_m) - place;
                });
            }
        }
    }

    /// Tests that two bodies collide and conserve momentum and angular momentum.
    #[test]
    fn what_collides_keeps_its_momentum() {
        let mut assembly = Assembly::default();
        let inertia = |mass_kg| Inertia { mass_kg, about_com_kg_m2: Matrix3::identity() * 0.01 };
        let moving =
            BodyMotion { velocity: Vector3::x(), ..BodyMotion::at(Vector3::new(-0.3, 0.1, 0.15)) };
        assembly.add_body(inertia(0.5), moving);
        assembly.add_body(inertia(1.0), BodyMotion::at(Vector3::zeros()));
        assembly.add(collision(Arc::new(BALL), FrictionModel::Tanh));
        let settings = Settings { gravity_m_s2: Vector3::zeros(), ..Settings::default() };
        let mut system = System::new(Settings { tolerance: 1e-12, ..settings }, assembly);
        let before = (system.momentum(), system.angular_momentum());
        for _ in 0..1000 {
            system.step(1e-3).unwrap();
        }
        let after = (system.momentum(), system.angular_momentum());
        assert!(system.motions()[1].velocity.norm() > 0.1, "{:?}", system.motions());
        assert!((after.0 - before.0).norm() < 1e-9, "{before:?}, {after:?}");
        // First order in the step, because positions are those of the end of the step.
        assert!((after.1 - before.1).norm() < 1e-3, "{before:?}, {after:?}");
    }
}
