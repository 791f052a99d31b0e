//! Springs and strings between points of bodies, for cloth and cables (thesis 4.5.4).

use crate::force::{Derivative, Force, View, Wrench};
use crate::motion::BodyMotion;
use crate::points::{PointForce, Points};
use nalgebra::{Matrix3, Vector3};

/// Spring that keeps two points at a distance.
#[derive(Clone, Debug, PartialEq)]
pub struct Spring {
    /// Connected points.
    pub ends: Points,
    /// Length without force, m.
    pub rest_m: f64,
    /// Stiffness, N/m.
    pub stiffness_n_m: f64,
    /// Damping of the length's rate, N·s/m. Strings are undamped: otherwise their force would jump when they become taut.
    pub damping_n_s_m: f64,
    /// True for a string, which cannot push.
    pub string: bool,
}

impl Spring {
    fn pull(&self, now: &[BodyMotion]) -> PointForce {
        let (offset, velocity) = self.ends.apart(now);
        let length = offset.norm().max(f64::MIN_POSITIVE);
        let stretch = length - self.rest_m;
        if self.string && stretch <= 0.0 {
            let none = Matrix3::zeros();
            return PointForce { force: Vector3::zeros(), by_offset: none, by_velocity: none };
        }
        let damping = if self.string { 0.0 } else { self.damping_n_s_m };
        let along = offset / length;
        let across = (Matrix3::identity() - along * along.transpose()) / length;
        let tension = self.stiffness_n_m * stretch + damping * along.dot(&velocity);
        // δ(along) = across δ(offset).
        let by_length =
            along.transpose() * self.stiffness_n_m + velocity.transpose() * across * damping;
        PointForce {
            force: along * tension,
            by_offset: along * by_length + across * tension,
            by_velocity: along * along.transpose() * damping,
        }
    }
}

impl Force for Spring {
    fn bodies(&self) -> &[usize] {
        &self.ends.bodies
    }

    fn wrenches(&self, view: &View<'_>, wrenches: &mut [Wrench]) {
        self.ends.add_wrenches(view.now, &self.pull(view.now).force, wrenches);
    }

    fn derivatives(
        &self,
        view: &View<'_>,
        wrenches: &mut [Wrench],
        derivatives: &mut [Derivative],
    ) {
        let pull = self.pull(view.now);
        self.ends.add_wrenches(view.now, &pull.force, wrenches);
        self.ends.add_derivatives(view.now, &pull, view.tame, derivatives);
    }

    fn energy(&self, now: &[BodyMotion]) -> f64 {
        let stretch = self.ends.apart(now).0.norm() - self.rest_m;
        let stretch = if self.string { stretch.max(0.0) } else { stretch };
        0.5 * self.stiffness_n_m * stretch * stretch
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::check::agrees_with_finite_differences;

    #[test]
    fn springs_and_strings_have_their_derivatives() {
        let points = [Vector3::new(0.1, -0.2, 0.05), Vector3::new(-0.03, 0.1, 0.2)];
        for (rest_m, string) in [(0.2, false), (0.05, true), (3.0, true)] {
            agrees_with_finite_differences(&Spring {
                ends: Points { bodies: [0, 1], points },
                rest_m,
                stiffness_n_m: 50.0,
                damping_n_s_m: 3.0,
                string,
            });
        }
    }
}
