//! Evaluated sample of the timeline: variables, forward kinematics and wheel frames.

use crate::problem::ContactGround;
use crate::problem::variables::Layout;
use nalgebra::{DVector, Matrix3, Vector3};
use rollwalk_multibody::euler::{Model, Pose, SweptMoment};
use rollwalk_multibody::ground::{Elevation, ElevationMap};

/// Sample with all values that terms use.
#[derive(Clone, Debug)]
pub struct State {
    /// Variables, lifted to the timeline, SI units.
    pub vars: DVector<f64>,
    /// Kinematics of the robot at `q`.
    pub pose: Pose,
    /// Contact frames of the end effectors, in robot order.
    pub frames: Vec<ContactFrame>,
    /// Angular momentum in the interval to the next timeline sample, times the interval's length. `None` at the last timeline
    /// sample.
    pub swept_to_next: Option<SweptMoment>,
}

/// Frame W(α) of a wheel (Eq. 2.2) with its derivatives; for a foot, the frame of a sphere.
///
/// The wheel's rest frame is t̂ = x, â = y, ρ̂ = −r·z. Tilt and yaw take the axis from there to every direction except the
/// vertical. They are therefore absolute and have the same meaning for every wheel. On ground with the normal n, of any length,
///
/// ```text
/// g = n − (a·n) a        ρ = −r g/|g|        t = a × g/|g|
/// ```
#[derive(Clone, Copy, Debug)]
pub struct ContactFrame {
    /// Rolling direction t, along the ground.
    pub rolling: Vector3<f64>,
    /// Wheel axis a.
    pub axis: Vector3<f64>,
    /// Vector ρ from the centre to the contact point.
    pub to_contact: Vector3<f64>,
    /// Derivative ∂a/∂tilt. The derivative ∂a/∂yaw is v × a.
    pub d_axis_tilt: Vector3<f64>,
    /// Derivatives ∂ρ/∂tilt and ∂ρ/∂yaw.
    pub d_to_contact: [Vector3<f64>; 2],
    /// Derivatives ∂t/∂tilt and ∂t/∂yaw.
    pub d_rolling: [Vector3<f64>; 2],
    /// Ground at the contact point.
    pub ground: Elevation,
    /// Normal n of the ground at the contact point.
    pub normal: Vector3<f64>,
    /// Derivatives with respect to the normal. `None` on level ground, whose normal is constant.
    pub by_normal: Option<NormalDerivatives>,
}

/// Derivatives of a contact frame with respect to the normal of the ground.
#[derive(Clone, Copy, Debug)]
pub struct NormalDerivatives {
    /// Derivative ∂ρ/∂n.
    pub d_to_contact: Matrix3<f64>,
    /// Derivative ∂t/∂n.
    pub d_rolling: Matrix3<f64>,
}

/// Derivative of a vector with respect to a turn about the vertical.
pub fn d_yaw(v: &Vector3<f64>) -> Vector3<f64> {
    Vector3::new(-v.y, v.x, 0.0)
}

/// Rolling direction t of a wheel, from the yaw of its axis.
pub fn rolling_direction(yaw_rad: f64) -> Vector3<f64> {
    let (s, c) = yaw_rad.sin_cos();
    Vector3::new(c, s, 0.0)
}

impl ContactFrame {
    /// Frame at a contact point. `tilt_and_yaw_rad` contains the angles of the wheel's axis; `None` for a foot.
    pub fn new(
        radius_m: f64,
        tilt_and_yaw_rad: Option<[f64; 2]>,
        ground: &ElevationMap,
        contact: &Vector3<f64>,
    ) -> Self {
        let frame = match tilt_and_yaw_rad {
            Some([tilt_rad, yaw_rad]) => Self::wheel(radius_m, tilt_rad, yaw_rad),
            None => Self::foot(radius_m),
        };
        let here = ground.at(contact);
        let frame = Self { ground: here, ..frame };
        match ground.is_level() {
            true => frame,
            false => frame.on_slope(radius_m, &here.normal()),
        }
    }

    /// Frame at the contact point of an end effector with the given centre, whether it touches the ground or not.
    pub fn below(
        radius_m: f64,
        tilt_and_yaw_rad: Option<[f64; 2]>,
        ground: &ElevationMap,
        center: &Vector3<f64>,
    ) -> Self {
        if ground.is_level() {
            return Self::new(radius_m, tilt_and_yaw_rad, ground, center);
        }
        let flat = match tilt_and_yaw_rad {
            Some([tilt_rad, yaw_rad]) => Self::wheel(radius_m, tilt_rad, yaw_rad),
            None => Self::foot(radius_m),
        };
        let normal = ground.normal_below(center, |normal| {
            let frame = flat.on_slope(radius_m, normal);
            let by_normal = frame.by_normal.map(|by| by.d_to_contact).unwrap_or_default();
            (frame.to_contact, by_normal)
        });
        let contact = center + flat.on_slope(radius_m, &normal).to_contact;
        Self::new(radius_m, tilt_and_yaw_rad, ground, &contact)
    }

    /// Frame of a wheel on level ground.
    pub fn wheel(radius_m: f64, tilt_rad: f64, yaw_rad: f64) -> Self {
        let (st, ct) = tilt_rad.sin_cos();
        let (sy, cy) = yaw_rad.sin_cos();
        let turn = |y: f64, z: f64| Vector3::new(-sy * y, cy * y, z);
        let rolling = Vector3::new(cy, sy, 0.0);
        let to_contact = turn(radius_m * st, -radius_m * ct);
        Self {
            rolling,
            axis: turn(ct, st),
            to_contact,
            d_axis_tilt: turn(-st, ct),
            d_to_contact: [turn(radius_m * ct, radius_m * st), d_yaw(&to_contact)],
            d_rolling: [Vector3::zeros(), d_yaw(&rolling)],
            ground: Elevation::default(),
            normal: Vector3::z(),
            by_normal: None,
        }
    }

    /// Frame of a foot on level ground: a sphere that touches the ground below its centre.
    pub fn foot(radius_m: f64) -> Self {
        Self {
            rolling: Vector3::zeros(),
            axis: Vector3::zeros(),
            to_contact: Vector3::new(0.0, 0.0, -radius_m),
            d_axis_tilt: Vector3::zeros(),
            d_to_contact: [Vector3::zeros(); 2],
            d_rolling: [Vector3::zeros(); 2],
            ground: Elevation::default(),
            normal: Vector3::z(),
            by_normal: None,
        }
    }

    /// Frame of a wheel half-way between two samples, with the tilt and yaw there.
    pub fn between(radius_m: f64, [tilt_rad, yaw_rad]: [f64; 2], ends: [&Self; 2]) -> Self {
        let frame = Self::wheel(radius_m, tilt_rad, yaw_rad);
        match ends[0].by_normal {
            None => frame,
            Some(_) => frame.on_slope(radius_m, &((ends[0].normal + ends[1].normal) * 0.5)),
        }
    }

    /// Frame with the same axis on ground with another normal.
    fn on_slope(self, radius_m: f64, normal: &Vector3<f64>) -> Self {
        let axis = self.axis;
        let along = axis.dot(normal);
        let upward = normal - axis * along;
        let length = upward.norm();
        let unit = upward / length;
        // u = g/|g| by g, and by the normal.
        let by_upward = (Matrix3::identity() - unit * unit.transpose()) / length;
        let by_normal = by_upward * (Matrix3::identity() - axis * axis.transpose());
        let d_axis = [self.d_axis_tilt, d_yaw(&axis)];
        let d_unit = d_axis.map(|d_axis| by_upward * -(d_axis * along + axis * d_axis.dot(normal)));
        Self {
            rolling: axis.cross(&unit),
            to_contact: unit * -radius_m,
            d_to_contact: d_unit.map(|d_unit| d_unit * -radius_m),
            d_rolling: [0, 1].map(|k| d_axis[k].cross(&unit) + axis.cross(&d_unit[k])),
            normal: *normal,
            by_normal: Some(NormalDerivatives {
                d_to_contact: by_normal * -radius_m,
                d_rolling: axis.cross_matrix() * by_normal,
            }),
            ..self
        }
    }
}

/// Tilt and yaw of a wheel axis in the world, rad. The yaw is the one nearest to `near_yaw_rad`.
pub fn tilt_and_yaw(axis: &Vector3<f64>, near_yaw_rad: f64) -> (f64, f64) {
    let tilt = axis.z.atan2(axis.x.hypot(axis.y));
    let yaw = (-axis.x).atan2(axis.y);
    let turns = ((near_yaw_rad - yaw) / std::f64::consts::TAU).round();
    (tilt, yaw + turns * std::f64::consts::TAU)
}

impl State {
    /// Evaluates a sample without the derivatives of its kinematics.
    pub fn new(
        model: &Model,
        layout: &Layout,
        contacts: &[ContactGround],
        vars: DVector<f64>,
    ) -> Self {
        let pose = model.pose_values(&vars.rows(0, layout.dofs).into_owned());
        let mut state = Self { vars, pose, frames: Vec::new(), swept_to_next: None };
        state.update_frames(model, layout, contacts);
        state
    }

    /// Returns true if the state is one of this robot, so that its memory can be reused.
    pub fn is_of(&self, model: &Model, layout: &Layout) -> bool {
        let Pose { frames, end_effectors, .. } = &self.pose;
        let robot = model.robot();
        self.vars.len() == layout.len
            && frames.link_origins.len() == robot.links.len()
            && frames.joint_axes.len() == robot.joints.len()
            && end_effectors.len() == robot.end_effectors.len()
    }

    /// Evaluates the sample again after a change of its variables.
    pub fn update(&mut self, model: &Model, layout: &Layout, contacts: &[ContactGround]) {
        model.update_pose(&self.vars.as_slice()[..layout.dofs], &mut self.pose);
        self.update_frames(model, layout, contacts);
    }

    fn update_frames(&mut self, model: &Model, layout: &Layout, contacts: &[ContactGround]) {
        let Self { vars, frames, .. } = self;
        let end_effectors = layout.end_effectors.iter().zip(&model.robot().end_effectors);
        frames.clear();
        frames.extend(end_effectors.zip(contacts).map(|((at, ee), ground)| {
            let angles = at.wheel.map(|wheel| [vars[wheel.tilt], vars[wheel.yaw]]);
            let contact = vars.fixed_rows::<3>(at.position).into();
            ContactFrame::new(ee.radius_m, angles, &ground.map, &contact)
        }));
    }

    /// Sums of the ground forces and of their moments about the centre of mass.
    pub fn wrench(&self, layout: &Layout) -> [Vector3<f64>; 2] {
        let mut sum = [Vector3::zeros(); 2];
        for ee in &layout.end_effectors {
            let force = self.vector(ee.force);
            sum[0] += force;
            sum[1] += (self.vector(ee.position) - self.pose.com).cross(&force);
        }
        sum
    }

    /// Returns three consecutive variables as a vector.
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
