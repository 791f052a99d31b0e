//! Forces between a point of one body and a point of another, for ball joints, springs and attachments.

use crate::force::{Derivative, StateBlock, Wrench};
use crate::motion::BodyMotion;
use nalgebra::{Matrix3, Vector3};
use rollwalk_multibody::rotation::skew;

/// Pair of points on two bodies.
#[derive(Clone, Debug, PartialEq)]
pub struct Points {
    /// Indices of the two bodies.
    pub bodies: [usize; 2],
    /// Point on each body, from its centre of mass in body axes, m; 0 for a particle.
    pub points: [Vector3<f64>; 2],
}

/// Force, and its derivatives with respect to offset and velocity of the second point relative to the first.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct PointForce {
    /// Force on the first point, N; the opposite force acts on the second.
    pub force: Vector3<f64>,
    /// Derivative with respect to the offset, N/m.
    pub by_offset: Matrix3<f64>,
    /// Derivative with respect to the velocity, N·s/m.
    pub by_velocity: Matrix3<f64>,
}

/// Product of the matrices of two cross products: [a] [b] = b aᵀ − (a·b) 1.
fn twice(a: &Vector3<f64>, b: &Vector3<f64>) -> Matrix3<f64> {
    b * a.transpose() - Matrix3::from_diagonal_element(a.dot(b))
}

impl Points {
    /// Creates the pair of points that coincide at a position in world axes, m.
    pub fn at(bodies: [usize; 2], motions: &[BodyMotion], place: &Vector3<f64>) -> Self {
        let points = bodies.map(|body| {
            let motion = &motions[body];
            motion.rotation.transpose() * (place - motion.position)
        });
        Self { bodies, points }
    }

    /// Offset, m, and velocity, m/s, of the second point relative to the first.
    pub(crate) fn apart(&self, now: &[BodyMotion]) -> (Vector3<f64>, Vector3<f64>) {
        let [first, second] = [0, 1].map(|k| now[k].point(&self.points[k]));
        (second.0 - first.0, second.1 - first.1)
    }

    fn arms(&self, now: &[BodyMotion]) -> [Vector3<f64>; 2] {
        [0, 1].map(|k| now[k].rotation * self.points[k])
    }

    pub(crate) fn add_wrenches(
        &self,
        now: &[BodyMotion],
        force: &Vector3<f64>,
        wrenches: &mut [Wrench],
    ) {
        let arms = self.arms(now);
        for (k, sign) in [(0, 1.0), (1, -1.0)] {
            wrenches[k].force += force * sign;
            wrenches[k].moment += arms[k].cross(force) * sign;
        }
    }

    /// Adds the derivatives of a spring and damper that act alike in all directions, with stiffness and damping in N/m and
    /// N·s/m. `force` acts on the first point.
    pub(crate) fn add_derivatives_alike(
        &self,
        now: &[BodyMotion],
        [stiffness_n_m, damping_n_s_m]: [f64; 2],
        force: &Vector3<f64>,
        tame: bool,
        derivatives: &mut [Derivative],
    ) {
        let arms = self.arms(now);
        for (j, of_j) in [(0, -1.0), (1, 1.0)] {
            let arm = arms[j];
            for (i, on_i) in [(0, of_j), (1, -of_j)] {
                let derivative = &mut derivatives[2 * i + j];
                let (own, stiffness, damping) =
                    (arms[i], on_i * stiffness_n_m, on_i * damping_n_s_m);
                let by_offset = Matrix3::from_diagonal_element(stiffness);
                derivative.add_force(StateBlock::Position, &by_offset);
                derivative.add_moment(StateBlock::Position, &skew(&(own * stiffness)));
                derivative.add_force(StateBlock::Rotation, &skew(&(arm * -stiffness)));
                let mut turning = twice(&own, &arm) * -stiffness;
                if damping != 0.0 {
                    // δ(ω × ρ) = [ω] δρ with δρ = −[ρ] δθ.
                    let spinning = twice(&now[j].spin, &arm) * -damping;
                    derivative.add_force(StateBlock::Rotation, &spinning);
                    turning += skew(&own) * spinning;
                    let by_velocity = Matrix3::from_diagonal_element(damping);
                    derivative.add_force(StateBlock::Velocity, &by_velocity);
                    derivative.add_moment(StateBlock::Velocity, &skew(&(own * damping)));
                    derivative.add_force(StateBlock::Spin, &skew(&(arm * -damping)));
                    derivative.add_moment(StateBlock::Spin, &(twice(&own, &arm) * -damping));
                }
                if i == j && !tame {
                    // The moment's own arm rotates: δρ × f = [f] [ρ] δθ.
                    turning += twice(force, &own) * (on_i * of_j);
                }
                derivative.add_moment(StateBlock::Rotation, &turning);
            }
        }
    }

    pub(crate) fn add_derivatives(
        &self,
        now: &[BodyMotion],
        pull: &PointForce,
        tame: bool,
        derivatives: &mut [Derivative],
    ) {
        let levers = self.arms(now).map(|arm| skew(&arm));
        // Most joints have no damping.
        let damps = pull.by_velocity != Matrix3::zeros();
        for (j, of_j) in [(0, -1.0), (1, 1.0)] {
            // Derivative of the force on the first body with respect to the motion of body j.
            let lever = levers[j];
            // δ(ω × ρ) = [ω] δρ with δρ = −[ρ] δθ.
            let mut turning = pull.by_offset * lever;
            if damps {
                turning += pull.by_velocity * skew(&now[j].spin) * lever;
            }
            let blocks = [
                (StateBlock::Position, pull.by_offset * of_j),
                (StateBlock::Rotation, turning * -of_j),
                (StateBlock::Velocity, pull.by_velocity * of_j),
                (StateBlock::Spin, pull.by_velocity * lever * -of_j),
            ];
            let blocks = if damps { &blocks[..] } else { &blocks[..2] };
            for (i, on_i) in [(0, 1.0), (1, -1.0)] {
                let derivative = &mut derivatives[2 * i + j];
                for (by, block) in blocks {
                    derivative.add_force(*by, &(block * on_i));
                    derivative.add_moment(*by, &(levers[i] * block * on_i));
                }
                if i == j && !tame {
                    // The moment's own arm rotates: δρ × f = [f] [ρ] δθ.
                    derivative
                        .add_moment(StateBlock::Rotation, &(skew(&pull.force) * levers[i] * on_i));
                }
            }
        }
    }
}
