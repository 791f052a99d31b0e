//! Pushes: forces on a body for a limited time.

use crate::force::{Derivative, Force, View, Wrench};
use nalgebra::{Rotation3, Vector3};

/// Constant force on the centre of mass of one body, in world axes.
#[derive(Clone, Debug)]
pub struct Push {
    /// Index of the body.
    pub body: [usize; 1],
    /// Force, N.
    pub force_n: Vector3<f64>,
}

impl Force for Push {
    fn bodies(&self) -> &[usize] {
        &self.body
    }

    fn wrenches(&self, _view: &View<'_>, wrenches: &mut [Wrench]) {
        wrenches[0].force += self.force_n;
    }

    fn derivatives(&self, view: &View<'_>, wrenches: &mut [Wrench], _: &mut [Derivative]) {
        self.wrenches(view, wrenches);
    }
}

/// Push on a robot, with start time, duration and force.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Shove {
    /// Start time, s.
    pub from_s: f64,
    /// Duration, s.
    pub duration_s: f64,
    /// Force forward, to the left and up in the robot's heading, N.
    pub force_n: Vector3<f64>,
}

impl Shove {
    /// Creates a push from its start time, s, its duration, s, and its force forward, to the left and up, N.
    pub fn new(from_s: f64, duration_s: f64, force_n: [f64; 3]) -> Self {
        Self { from_s, duration_s, force_n: force_n.into() }
    }
}

/// Mean force of all pushes over a step, in world axes, N, on a robot with the given heading, rad. The mean preserves the
/// impulse of a push for any step.
pub fn mean_force(shoves: &[Shove], from_s: f64, step_s: f64, heading_rad: f64) -> Vector3<f64> {
    let share = |shove: &Shove| {
        let begin = shove.from_s.max(from_s);
        let end = (shove.from_s + shove.duration_s).min(from_s + step_s);
        (end - begin).max(0.0) / step_s
    };
    let sum: Vector3<f64> = shoves.iter().map(|shove| shove.force_n * share(shove)).sum();
    Rotation3::from_axis_angle(&Vector3::z_axis(), heading_rad) * sum
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::check::agrees_with_finite_differences;
    use std::f64::consts::FRAC_PI_2;

    #[test]
    fn a_push_has_no_derivatives() {
        agrees_with_finite_differences(&Push { body: [0], force_n: Vector3::new(1.0, -2.0, 3.0) });
    }

    #[test]
    fn pushes_act_in_their_time_and_as_the_robot_faces() {
        let shove =
            |from_s, ahead| Shove { from_s, duration_s: 0.5, force_n: Vector3::x() * ahead };
        let shoves = [shove(1.0, 10.0), shove(1.25, 5.0)];
        let times =
            [(0.98, 0.0), (1.0, 10.0), (1.245, 12.5), (1.25, 15.0), (1.5, 5.0), (1.75, 0.0)];
        for (time_s, expected) in times {
            let force = mean_force(&shoves, time_s, 0.01, FRAC_PI_2);
            assert!((force - Vector3::y() * expected).norm() < 1e-9, "{time_s} s: {force:?}");
        }
        for step_s in [0.003, 0.01, 0.4, 5.0] {
            let steps = (5.0 / step_s) as u32 + 1;
            let forces =
                (0..steps).map(|k| mean_force(&shoves, f64::from(k) * step_s, step_s, 0.0));
            let impulse: f64 = forces.map(|force| force.x * step_s).sum();
            assert!((impulse - 7.5).abs() < 1e-9, "{impulse} N·s");
        }
    }
}
