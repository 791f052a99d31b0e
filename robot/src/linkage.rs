//! Crank and rod between a servo and its joint: four-bar and five-bar linkages.
//!
//! The pivot o of the crank is on the servo's link, the rod ends at p on the child link of the joint. With d = p − o, the crank
//! arm u at servo angle 0, and the rotation R(θ) about the servo's axis a, the rod of length r closes the loop:
//!
//! ```text
//! h(d, θ) = ½ (|d|² + |u|² − r²) − d · R(θ) u = 0
//! ```
//!
//! This is A cos θ + B sin θ = C, with two solutions. The nominal pose selects one of them. Derivatives of θ follow from those
//! of h; those of d from the joints between the servo's link and the child link.

use crate::model::{Joint, JointRatio, Linkage, Robot};
use nalgebra::{Isometry3, Matrix3, Point3, Translation3, UnitQuaternion, Vector3};
use std::f64::consts::{PI, TAU};

/// Largest cosine of the angle between the crank and the direction from its pivot to the end of the rod for which angles are
/// computed. Above 1, the loop does not close.
const STRAIGHT: f64 = 0.999_999;

/// Smallest sine of the angles between crank and rod, and between rod and the lever of the joint: 10 degrees. A linkage is
/// singular where one of them is 0.
pub(crate) const SINE_MIN: f64 = 0.17;
/// Smallest number of angles of each joint at which a linkage is checked.
const ANGLES: usize = 13;
/// Largest step between these angles, rad. Within 10 degrees of a singular pose, crank and rod turn by 0.35 rad.
const STEP_RAD: f64 = 0.2;
/// Maximum number of joints between the servo's link and the child link.
pub(crate) const PATH_MAX: usize = 3;

/// Map from joint angles to the angle of a servo with crank and rod.
#[derive(Clone, Debug, PartialEq)]
pub struct CrankMap {
    /// Joints between the servo's link and the child link, in this order.
    path: Vec<PathJoint>,
    pivot_m: Vector3<f64>,
    arm_m: Vector3<f64>,
    axis: Vector3<f64>,
    rod_end_m: Vector3<f64>,
    rod_m: f64,
    /// Sign of the solution of the nominal pose.
    side: f64,
    nominal_rad: f64,
}

#[derive(Clone, Debug, PartialEq)]
struct PathJoint {
    joint: usize,
    parent_from_joint: Isometry3<f64>,
    axis: Vector3<f64>,
}

/// Angle of a servo with its derivatives.
#[derive(Clone, Debug, PartialEq)]
pub struct CrankState {
    /// Angle of the servo, rad.
    pub angle_rad: f64,
    /// Derivatives with respect to the joints that turn the servo, in path order.
    pub ratios: Vec<JointRatio>,
    /// Second derivatives for each pair of joints, in both orders.
    pub bends: Vec<(usize, usize, f64)>,
    /// Sines of the angles between crank and rod, and between rod and the lever of the joint. A linkage is singular where one of
    /// them is 0.
    pub sines: [f64; 2],
}

impl CrankMap {
    /// Map of a joint's servo. `None` if the servo's link does not carry the joint, or if crank or rod has no length.
    pub fn new(robot: &Robot, joint: &Joint, linkage: &Linkage) -> Option<Self> {
        let mut path = Vec::new();
        let mut link = joint.child;
        while link != linkage.link {
            let index = robot.joints.iter().position(|of| of.child == link)?;
            let of = &robot.joints[index];
            path.push(PathJoint {
                joint: index,
                parent_from_joint: of.parent_from_joint,
                axis: of.axis_in_joint,
            });
            link = of.parent;
            if path.len() > robot.joints.len() {
                return None;
            }
        }
        if path.is_empty() {
            return None;
        }
        path.reverse();
        let nominal: Vec<_> = robot.joints.iter().map(|joint| joint.nominal_rad).collect();
        let mut map = Self {
            path,
            pivot_m: linkage.pivot_in_link_m,
            arm_m: linkage.pin_in_link_m - linkage.pivot_in_link_m,
            axis: linkage.axis_in_link,
            rod_end_m: linkage.rod_in_child_m,
            rod_m: 0.0,
            side: 1.0,
            nominal_rad: linkage.nominal_rad,
        };
        let (end_m, _) = map.rod_end(&nominal);
        map.rod_m = (end_m - linkage.pin_in_link_m).norm();
        let [along, across, _] = map.coefficients(&(end_m - map.pivot_m));
        map.side = if across > 0.0 { -1.0 } else { 1.0 };
        (map.rod_m > 0.0 && along.hypot(across) > 0.0).then_some(map)
    }

    /// Joints that turn the servo.
    pub fn joints(&self) -> impl Iterator<Item = usize> + '_ {
        self.path.iter().map(|of| of.joint)
    }

    /// Calls `visit` with joint angles in a grid over the limits of the joints that turn a servo, until it returns false.
    pub(crate) fn for_each_pose(&self, robot: &Robot, mut visit: impl FnMut(&[f64]) -> bool) {
        let mut joint_rad: Vec<_> = robot.joints.iter().map(|joint| joint.nominal_rad).collect();
        let angles = |index: usize| {
            let joint = &robot.joints[index];
            let steps = (joint.position_max_rad - joint.position_min_rad) / STEP_RAD;
            (index, ANGLES.max(steps.ceil() as usize + 1))
        };
        let counts: Vec<_> =
            self.path.iter().map(|of| of.joint).take(PATH_MAX).map(angles).collect();
        for pose in 0..counts.iter().map(|(_, count)| count).product() {
            let mut rest = pose;
            for &(index, count) in &counts {
                let joint = &robot.joints[index];
                let part = (rest % count) as f64 / (count - 1) as f64;
                joint_rad[index] =
                    joint.position_min_rad * (1.0 - part) + joint.position_max_rad * part;
                rest /= count;
            }
            if !visit(&joint_rad) {
                return;
            }
        }
    }

    /// Map with the joints numbered 0, 1, … in path order.
    #[must_use]
    pub fn renumbered(mut self) -> Self {
        self.path.iter_mut().enumerate().for_each(|(number, of)| of.joint = number);
        self
    }

    /// Length of the rod, m.
    pub fn rod_m(&self) -> f64 {
        self.rod_m
    }

    /// Distance of the rod's end from the nominal position of the pin, m.
    pub fn distance_from_nominal_pin_m(&self, joint_rad: &[f64]) -> f64 {
        (self.rod_end(joint_rad).0 - self.pivot_m - self.arm_m).norm()
    }

    /// End of the rod in the servo's link, m, and the axis and origin of each joint of the path there.
    fn rod_end(&self, joint_rad: &[f64]) -> (Vector3<f64>, Vec<[Vector3<f64>; 2]>) {
        let mut pose = Isometry3::identity();
        let mut joints = Vec::with_capacity(self.path.len());
        for of in &self.path {
            pose *= of.parent_from_joint;
            joints.push([pose.rotation * of.axis, pose.translation.vector]);
            let turn = UnitQuaternion::from_scaled_axis(of.axis * joint_rad[of.joint]);
            pose *= Isometry3::from_parts(Translation3::identity(), turn);
        }
        ((pose * Point3::from(self.rod_end_m)).coords, joints)
    }

    /// Coefficients A, B and C of the closed loop.
    fn coefficients(&self, d: &Vector3<f64>) -> [f64; 3] {
        let along = self.axis * self.arm_m.dot(&self.axis);
        let across = self.arm_m - along;
        let rest = 0.5 * (d.norm_squared() + self.arm_m.norm_squared() - self.rod_m.powi(2));
        [d.dot(&across), d.dot(&self.axis.cross(&across)), rest - d.dot(&along)]
    }

    /// Angle of the crank from its nominal direction, rad, and the cosine that must be within ±1 for the loop to close.
    fn crank_rad(&self, d: &Vector3<f64>) -> (f64, f64) {
        let [a, b, c] = self.coefficients(d);
        let cosine = c / a.hypot(b);
        let angle = b.atan2(a) + self.side * cosine.clamp(-STRAIGHT, STRAIGHT).acos();
        (angle - TAU * ((angle + PI) / TAU).floor(), cosine)
    }

    /// Angle of the servo, rad.
    pub fn angle_rad(&self, joint_rad: &[f64]) -> f64 {
        let (end_m, _) = self.rod_end(joint_rad);
        self.nominal_rad + self.crank_rad(&(end_m - self.pivot_m)).0
    }

    /// Angle of the servo with its derivatives.
    pub fn state(&self, joint_rad: &[f64]) -> CrankState {
        let (end_m, joints) = self.rod_end(joint_rad);
        let d = end_m - self.pivot_m;
        let (crank_rad, cosine) = self.crank_rad(&d);
        let turn = UnitQuaternion::from_scaled_axis(self.axis * crank_rad);
        let arm = turn * self.arm_m;
        let rod = d - arm;
        // h_θ = −d · (a × R u), h_d = d − R u, h_dd = 1, h_dθ = −a × R u, h_θθ = d · R u without its part along the axis.
        let tangent = self.axis.cross(&arm);
        let by_angle = d.dot(&tangent);
        let gradient = rod / by_angle;
        let bend = d.dot(&(arm - self.axis * arm.dot(&self.axis)));
        let mixed = tangent * gradient.transpose();
        let curvature = (Matrix3::identity() - mixed - mixed.transpose()
            + gradient * gradient.transpose() * bend)
            / by_angle;
        let by_joint: Vec<_> =
            joints.iter().map(|[axis, origin]| axis.cross(&(end_m - origin))).collect();
        let mut bends = Vec::new();
        for (j, of) in self.path.iter().enumerate() {
            for (k, other) in self.path.iter().enumerate() {
                let second = joints[j.min(k)][0].cross(&by_joint[j.max(k)]);
                let value = by_joint[j].dot(&(curvature * by_joint[k])) + gradient.dot(&second);
                bends.push((of.joint, other.joint, value));
            }
        }
        let ratio = |(of, by): (&PathJoint, &Vector3<f64>)| JointRatio {
            joint: of.joint,
            ratio: gradient.dot(by),
        };
        let lever = by_joint.last().map_or(0.0, |by| rod.dot(by) / (rod.norm() * by.norm()));
        let at_crank = by_angle / (rod.norm() * tangent.norm());
        CrankState {
            angle_rad: self.nominal_rad + crank_rad,
            ratios: self.path.iter().zip(&by_joint).map(ratio).collect(),
            bends,
            sines: if cosine.abs() < STRAIGHT { [at_crank, lever] } else { [0.0; 2] },
        }
    }
}
