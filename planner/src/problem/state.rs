//! Evaluated sample of the timeline: variables, forward kinematics and wheel frames.

use crate::problem::variables::Layout;
use nalgebra::{DVector, Vector3};
use rollwalk_multibody::euler::{Model, Pose, SweptMoment};

/// A sample with all values that terms use.
#[derive(Clone, Debug)]
pub struct State {
    /// The variables, lifted to the timeline, SI units.
    pub vars: DVector<f64>,
    /// Kinematics of the robot at `q`.
    pub pose: Pose,
    /// Contact frames of the end effectors, in robot order.
    pub frames: Vec<ContactFrame>,
    /// Angular momentum on the interval to the next sample of the timeline, times its length; `None` at the last.
    pub swept_to_next: Option<SweptMoment>,
}

/// The frame W(α) of a wheel (Eq. 2.2) with its derivatives; for a foot the frame about the vertical.
///
/// From the wheel's rest frame t̂ = x, â = y, ρ̂ = −r·z every axis but the vertical can be reached, so tilt and yaw
/// are absolute and defined in the same way for every wheel.
#[derive(Clone, Copy, Debug)]
pub struct ContactFrame {
    /// Rolling direction t, horizontal.
    pub rolling: Vector3<f64>,
    /// Wheel axis a.
    pub axis: Vector3<f64>,
    /// Vector ρ from the centre to the contact point.
    pub to_contact: Vector3<f64>,
    /// ∂a/∂tilt; ∂a/∂yaw is v × a.
    pub d_axis_tilt: Vector3<f64>,
    /// ∂ρ/∂tilt; ∂ρ/∂yaw is v × ρ.
    pub d_to_contact_tilt: Vector3<f64>,
}

/// Derivative of a vector with respect to a turn about the vertical.
pub fn d_yaw(v: &Vector3<f64>) -> Vector3<f64> {
    Vector3::new(-v.y, v.x, 0.0)
}

/// Rolling direction t of a wheel with this axis yaw.
pub fn rolling_direction(yaw_rad: f64) -> Vector3<f64> {
    let (s, c) = yaw_rad.sin_cos();
    Vector3::new(c, s, 0.0)
}

impl ContactFrame {
    /// Frame of a wheel.
    pub fn wheel(radius_m: f64, tilt_rad: f64, yaw_rad: f64) -> Self {
        let (st, ct) = tilt_rad.sin_cos();
        let (sy, cy) = yaw_rad.sin_cos();
        let turn = |y: f64, z: f64| Vector3::new(-sy * y, cy * y, z);
        Self {
            rolling: rolling_direction(yaw_rad),
            axis: turn(ct, st),
            to_contact: turn(radius_m * st, -radius_m * ct),
            d_axis_tilt: turn(-st, ct),
            d_to_contact_tilt: turn(radius_m * ct, radius_m * st),
        }
    }

    /// Frame of a foot: a sphere that touches the ground below its centre.
    pub fn foot(radius_m: f64) -> Self {
        Self {
            rolling: Vector3::zeros(),
            axis: Vector3::zeros(),
            to_contact: Vector3::new(0.0, 0.0, -radius_m),
            d_axis_tilt: Vector3::zeros(),
            d_to_contact_tilt: Vector3::zeros(),
        }
    }
}

/// Tilt and yaw of a wheel axis given in world, rad. The yaw is the one nearest to `near_yaw_rad`.
pub fn tilt_and_yaw(axis: &Vector3<f64>, near_yaw_rad: f64) -> (f64, f64) {
    let tilt = axis.z.atan2(axis.x.hypot(axis.y));
    let yaw = (-axis.x).atan2(axis.y);
    let turns = ((near_yaw_rad - yaw) / std::f64::consts::TAU).round();
    (tilt, yaw + turns * std::f64::consts::TAU)
}

impl State {
    /// Evaluates a sample, without derivatives of its kinematics.
    pub fn new(model: &Model, layout: &Layout, vars: DVector<f64>) -> Self {
        let pose = model.pose_values(&vars.rows(0, layout.dofs).into_owned());
        let frames = layout
            .end_effectors
            .iter()
            .zip(&model.robot().end_effectors)
            .map(|(at, ee)| match at.wheel {
                Some(wheel) => ContactFrame::wheel(ee.radius_m, vars[wheel.tilt], vars[wheel.yaw]),
                None => ContactFrame::foot(ee.radius_m),
            })
            .collect();
        Self { vars, pose, frames, swept_to_next: None }
    }

    /// Sum of the ground forces, and of their moments about the centre of mass.
    pub fn wrench(&self, layout: &Layout) -> [Vector3<f64>; 2] {
        let mut sum = [Vector3::zeros(); 2];
        for ee in &layout.end_effectors {
            let force = self.vector(ee.force);
            sum[0] += force;
            sum[1] += (self.vector(ee.position) - self.pose.com).cross(&force);
        }
        sum
    }

    /// Three consecutive variables as a vector.
    pub fn vector(&self, first: usize) -> Vector3<f64> {
        self.vars.fixed_rows::<3>(first).into()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn wheel_frame_is_right_handed_and_rolls_forward() {
        let frame = ContactFrame::wheel(0.05, 0.3, -1.1);
        // Eq. 2.2: ρ̂ = â × t̂·r points down for v up (the printed t̂ × â points up).
        assert!((frame.axis.cross(&frame.rolling) * 0.05 - frame.to_contact).norm() < 1e-15);
        // −a × ρ = r·t: a positive speed rolls along t at any tilt.
        let rolled = -frame.axis.cross(&frame.to_contact);
        assert!((rolled - frame.rolling * 0.05).norm() < 1e-15);
        assert!(frame.rolling.z == 0.0 && frame.to_contact.z < 0.0);
    }

    #[test]
    fn tilt_and_yaw_invert_the_frame() {
        for (tilt, yaw) in [(0.0, 0.0), (0.4, 3.0), (-0.7, -3.1), (0.2, 7.5)] {
            let frame = ContactFrame::wheel(0.05, tilt, yaw);
            let (t, y) = tilt_and_yaw(&frame.axis, yaw + 0.3);
            assert!((t - tilt).abs() < 1e-12 && (y - yaw).abs() < 1e-12); // rounding only
        }
    }
}
