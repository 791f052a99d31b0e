//! Joints as stiff springs: points of two bodies that stay together, and axes that stay parallel (thesis 4.6.3).

use crate::force::{By, Derivative, Force, View, Wrench};
use crate::motion::Motion;
use nalgebra::{Matrix3, Vector3};
use rollwalk_multibody::rotation::skew;

/// A point of one body that is held to a point of another: a ball joint.
#[derive(Clone, Debug)]
pub struct Ball {
    /// The two bodies.
    pub bodies: [usize; 2],
    /// The point in each, from its centre of mass in body axes, m.
    pub points: [Vector3<f64>; 2],
    /// Stiffness, N/m.
    pub stiffness_n_m: f64,
    /// Damping of the distance, N·s/m.
    pub damping_n_s_m: f64,
}

/// An axis of one body that is held parallel to an axis of another; with a [`Ball`] it makes a hinge.
#[derive(Clone, Debug)]
pub struct ParallelAxes {
    /// The two bodies.
    pub bodies: [usize; 2],
    /// Unit axis in each, in body axes.
    pub axes: [Vector3<f64>; 2],
    /// Stiffness, N·m/rad for small angles; of angle e the moment is k sin e.
    pub stiffness_nm_rad: f64,
}

impl Ball {
    /// Arms of the two points and the force on the second body.
    fn force(&self, now: &[Motion]) -> ([Vector3<f64>; 2], Vector3<f64>) {
        let arms = [0, 1].map(|k| now[k].rotation * self.points[k]);
        let [(place_a, speed_a), (place_b, speed_b)] =
            [0, 1].map(|k| now[k].point(&self.points[k]));
        let spring = (place_a - place_b) * self.stiffness_n_m;
        (arms, spring + (speed_a - speed_b) * self.damping_n_s_m)
    }
}

impl Force for Ball {
    fn bodies(&self) -> &[usize] {
        &self.bodies
    }

    fn wrenches(&self, view: &View<'_>, wrenches: &mut [Wrench]) {
        let (arms, force) = self.force(view.now);
        for (k, sign) in [(0, -1.0), (1, 1.0)] {
            wrenches[k].force += force * sign;
            wrenches[k].moment += arms[k].cross(&force) * sign;
        }
    }

    fn derivatives(
        &self,
        view: &View<'_>,
        wrenches: &mut [Wrench],
        derivatives: &mut [Derivative],
    ) {
        self.wrenches(view, wrenches);
        let (arms, force) = self.force(view.now);
        let (stiffness, damping) = (self.stiffness_n_m, self.damping_n_s_m);
        for (j, of_j) in [(0, 1.0), (1, -1.0)] {
            // The force on body 1 by the motion of body j.
            let arm = skew(&arms[j]);
            // δ(ω × ρ) = [ω] δρ with δρ = −[ρ] δθ.
            let turning = -(arm * stiffness + skew(&view.now[j].spin) * arm * damping);
            let blocks = [
                (By::Position, Matrix3::identity() * (stiffness * of_j)),
                (By::Rotation, turning * of_j),
                (By::Velocity, Matrix3::identity() * (damping * of_j)),
                (By::Spin, arm * (-damping * of_j)),
            ];
            for (i, on_i) in [(0, -1.0), (1, 1.0)] {
                let derivative = &mut derivatives[2 * i + j];
                let lever = skew(&arms[i]);
                for (by, block) in &blocks {
                    derivative.add_force(*by, &(block * on_i));
                    derivative.add_moment(*by, &(lever * block * on_i));
                }
                if i == j {
                    // The moment's own arm turns: δρ × f = [f] [ρ] δθ.
                    derivative.add_moment(By::Rotation, &(skew(&force) * lever * on_i));
                }
            }
        }
    }

    fn energy(&self, now: &[Motion]) -> f64 {
        let [a, b] = [0, 1].map(|k| now[k].point(&self.points[k]).0);
        0.5 * self.stiffness_n_m * (b - a).norm_squared()
    }
}

impl ParallelAxes {
    fn axes(&self, now: &[Motion]) -> [Vector3<f64>; 2] {
        [0, 1].map(|k| now[k].rotation * self.axes[k])
    }
}

impl Force for ParallelAxes {
    fn bodies(&self) -> &[usize] {
        &self.bodies
    }

    fn wrenches(&self, view: &View<'_>, wrenches: &mut [Wrench]) {
        let [a, b] = self.axes(view.now);
        let moment = b.cross(&a) * self.stiffness_nm_rad;
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
        let [a, b] = self.axes(view.now).map(|axis| skew(&axis));
        // δ(b × a): δa = −[a] δθ_a, δb = −[b] δθ_b.
        let by = [-(b * a), a * b].map(|block| block * self.stiffness_nm_rad);
        for (i, on_i) in [(0, -1.0), (1, 1.0)] {
            for (j, block) in by.iter().enumerate() {
                derivatives[2 * i + j].add_moment(By::Rotation, &(block * on_i));
            }
        }
    }

    fn energy(&self, now: &[Motion]) -> f64 {
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
            bodies: [0, 1],
            points: [Vector3::new(0.1, -0.2, 0.05), Vector3::new(-0.03, 0.1, 0.2)],
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
        });
    }
}
