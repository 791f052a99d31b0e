//! Joints as stiff springs: coincident points and parallel axes of two bodies (thesis 4.5.4).

use crate::force::{Derivative, Force, StateBlock, View, Wrench};
use crate::motion::BodyMotion;
use crate::points::Points;
use nalgebra::{Matrix3, Vector3};
use rollwalk_multibody::rotation::skew;

/// Ball joint between a point of one body and a point of another. Between a body and a particle, the joint attaches a node of a
/// soft body. Two ball joints on one line form a hinge.
#[derive(Clone, Debug)]
pub struct Ball {
    /// Connected points.
    pub ends: Points,
    /// Stiffness, N/m.
    pub stiffness_n_m: f64,
    /// Damping of the relative velocity, N·s/m.
    pub damping_n_s_m: f64,
}

/// Constraint that keeps an axis of one body parallel to an axis of another. Together with a [`Ball`] it forms a hinge.
#[derive(Clone, Debug)]
pub struct ParallelAxes {
    /// Indices of the two bodies.
    pub bodies: [usize; 2],
    /// Unit axis in each body, in body axes.
    pub axes: [Vector3<f64>; 2],
    /// Stiffness k, N·m/rad for small angles. An angle e gives the moment k sin e.
    pub stiffness_nm_rad: f64,
    /// Damping of the relative spin across the first body's axis, N·m·s/rad. Rotation about the axis is free.
    pub damping_nm_s_rad: f64,
}

impl Ball {
    /// Force on the first point, N.
    fn pull(&self, now: &[BodyMotion]) -> Vector3<f64> {
        let (offset, velocity) = self.ends.apart(now);
        offset * self.stiffness_n_m + velocity * self.damping_n_s_m
    }
}

impl Force for Ball {
    fn bodies(&self) -> &[usize] {
        &self.ends.bodies
    }

    fn wrenches(&self, view: &View<'_>, wrenches: &mut [Wrench]) {
        self.ends.add_wrenches(view.now, &self.pull(view.now), wrenches);
    }

    fn derivatives(
        &self,
        view: &View<'_>,
        wrenches: &mut [Wrench],
        derivatives: &mut [Derivative],
    ) {
        let pull = self.pull(view.now);
        self.ends.add_wrenches(view.now, &pull, wrenches);
        let gains = [self.stiffness_n_m, self.damping_n_s_m];
        self.ends.add_derivatives_alike(view.now, gains, &pull, view.tame, derivatives);
    }

    fn energy(&self, now: &[BodyMotion]) -> f64 {
        0.5 * self.stiffness_n_m * self.ends.apart(now).0.norm_squared()
    }
}

impl ParallelAxes {
    fn axes(&self, now: &[BodyMotion]) -> [Vector3<f64>; 2] {
        [0, 1].map(|k| now[k].rotation * self.axes[k])
    }
}

impl Force for ParallelAxes {
    fn bodies(&self) -> &[usize] {
        &self.bodies
    }

    fn wrenches(&self, view: &View<'_>, wrenches: &mut [Wrench]) {
        let [a, b] = self.axes(view.now);
        let slip = view.now[1].spin - view.now[0].spin;
        let tilting = slip - a * a.dot(&slip);
        let moment = b.cross(&a) * self.stiffness_nm_rad - tilting * self.damping_nm_s_rad;
        wrenches[0].moment -= moment;
        wrenches[1].moment += moment;
    }

    fn derivatives(
        &self,
        view: &View<'_>,
        wrenches: &mut [Wrench],
        derivatives: &mut [Derivative],
    ) {
        self.wrenches(view, wrenches);
        let [axis, other] = self.axes(view.now);
        let [a, b] = [axis, other].map(|axis| skew(&axis));
        let slip = view.now[1].spin - view.now[0].spin;
        // δ(b × a) and δ((a·w) a): δa = −[a] δθ_a, δb = −[b] δθ_b.
        let about = Matrix3::identity() * axis.dot(&slip) + axis * slip.transpose();
        let by_first = b * a * -self.stiffness_nm_rad - about * a * self.damping_nm_s_rad;
        let by_turn = if view.tame {
            let stiffness = (Matrix3::identity() - axis * axis.transpose()) * self.stiffness_nm_rad;
            [stiffness - about * a * self.damping_nm_s_rad, -stiffness]
        } else {
            [by_first, a * b * self.stiffness_nm_rad]
        };
        let across = Matrix3::identity() - axis * axis.transpose();
        let by_spin = [1.0, -1.0].map(|sign| across * (sign * self.damping_nm_s_rad));
        for (i, on_i) in [(0, -1.0), (1, 1.0)] {
            for j in 0..2 {
                let derivative = &mut derivatives[2 * i + j];
                derivative.add_moment(StateBlock::Rotation, &(by_turn[j] * on_i));
                derivative.add_moment(StateBlock::Spin, &(by_spin[j] * on_i));
            }
        }
    }

    fn energy(&self, now: &[BodyMotion]) -> f64 {
        let [a, b] = self.axes(now);
        self.stiffness_nm_rad * (1.0 - a.dot(&b))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::check::agrees_with_finite_differences;

    #[test]
    fn a_ball_has_its_derivatives() {
        agrees_with_finite_differences(&Ball {
            ends: Points {
                bodies: [0, 1],
                points: [Vector3::new(0.1, -0.2, 0.05), Vector3::new(-0.03, 0.1, 0.2)],
            },
            stiffness_n_m: 50.0,
            damping_n_s_m: 3.0,
        });
    }

    #[test]
    fn parallel_axes_have_their_derivatives() {
        agrees_with_finite_differences(&ParallelAxes {
            bodies: [0, 1],
            axes: [Vector3::y(), Vector3::new(0.6, 0.8, 0.0)],
            stiffness_nm_rad: 7.0,
            damping_nm_s_rad: 0.8,
        });
    }
}
