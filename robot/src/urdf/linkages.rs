//! Crank and rod in the nominal pose, from those in the pose of the model, and limits of joints within which they close.

use super::draft::{DraftJoint, DraftLinkage};
use super::model::Linkage;
use crate::actuator::Actuator;
use crate::linkage::CrankMap;
use crate::linkage::{PATH_MAX, SINE_MIN};
use crate::model::{Joint, Robot};
use nalgebra::{Isometry3, Point3, Rotation3, Unit, Vector3};
use std::collections::BTreeMap;
use std::f64::consts::TAU;

/// Number of shares of a range that [`narrow`] tries, and the ratio of one to the next.
const SHARES: i32 = 45;
const SHARE: f64 = 0.9;

/// Links and frames of a linkage in the robot file.
pub(super) struct Placed {
    /// Link of the motor.
    pub link: usize,
    /// Frame of the motor's link of the model in this link.
    pub link_from_motor: Isometry3<f64>,
    /// Frame of the turned link of the model in that of the robot file.
    pub turned_from_model: Isometry3<f64>,
    /// Pose of the turned link in the motor's link, with joints at 0 and in the nominal pose.
    pub link_from_turned: [Isometry3<f64>; 2],
}

/// Linkage of a robot file. `None` if the rod does not reach from crank to link in the nominal pose.
///
/// With the crank's arm u, the rod's length r and d from the pivot to the end of the rod, the angle θ of the crank satisfies
/// A cos θ + B sin θ = C, as in [`crate::CrankMap`]. Of the two solutions, the one on the same side as in the model is chosen.
pub(super) fn nominal(of: &Linkage, at: &Placed) -> Option<DraftLinkage> {
    let point = |frame: &Isometry3<f64>, at: &Vector3<f64>| (frame * Point3::from(*at)).coords;
    let [pivot_m, pin_m] = [of.pivot_m, of.pin_m].map(|at_m| point(&at.link_from_motor, &at_m));
    let axis = Unit::try_new(at.link_from_motor.rotation * of.axis, 1e-9)?;
    let rod_end_m = point(&at.turned_from_model, &of.rod_end_m);
    let arm_m = pin_m - pivot_m;
    let along_m = axis.into_inner() * arm_m.dot(&axis);
    let across_m = arm_m - along_m;
    let d_m = at.link_from_turned.map(|pose| point(&pose, &rod_end_m) - pivot_m);
    // Direction of the end seen from the crank's arm, and the angle of the crank from it.
    let bearing = |d: &Vector3<f64>| {
        let (a, b) = (d.dot(&across_m), d.dot(&axis.cross(&across_m)));
        let rest = 0.5 * (d.norm_squared() + arm_m.norm_squared() - of.rod_m.powi(2));
        let cosine = (rest - d.dot(&along_m)) / a.hypot(b);
        (b.atan2(a), cosine)
    };
    let wrapped = |angle_rad: f64| angle_rad - TAU * (angle_rad / TAU).round();
    let crank_rad = |(bearing_rad, cosine): (f64, f64), side: f64| {
        wrapped(bearing_rad + side * cosine.clamp(-1.0, 1.0).acos())
    };
    // The crank of the model is at 0, next to the solution, even if the model is not closed.
    let off_rad = |side: &f64| crank_rad(bearing(&d_m[0]), *side).abs();
    let side = [1.0, -1.0].into_iter().min_by(|a, b| off_rad(a).total_cmp(&off_rad(b)))?;
    let of_pose = bearing(&d_m[1]);
    if of_pose.1.is_nan() || of_pose.1.abs() >= 1.0 {
        return None;
    }
    let nominal_rad = crank_rad(of_pose, side);
    let turn = Rotation3::from_axis_angle(&axis, nominal_rad);
    Some(DraftLinkage {
        link: at.link,
        pivot_m,
        pin_m: pivot_m + turn * arm_m,
        axis: axis.into_inner(),
        rod_end_m,
        nominal_rad,
    })
}

/// Narrows the ranges of joints towards the nominal pose until all linkages close with the margin of the rules. Ranges of joints
/// in `fixed` stay. Returns the joints with new ranges.
pub(super) fn narrow(joints: &mut [DraftJoint], fixed: &[bool]) -> Vec<usize> {
    let mut narrowed = Vec::new();
    if joints.iter().all(|joint| joint.linkage.is_none()) {
        return narrowed;
    }
    let mut robot = skeleton(joints);
    for index in 0..joints.len() {
        let joint = &robot.joints[index];
        let crank = joint.linkage.as_ref().and_then(|of| CrankMap::new(&robot, joint, of));
        let Some(crank) = crank.filter(|crank| crank.joints().count() <= PATH_MAX) else {
            continue;
        };
        let path: Vec<_> = crank.joints().filter(|&joint| !fixed[joint]).collect();
        let wide = robot.joints.clone();
        let set = |robot: &mut Robot, joint: usize, [lower, upper]: [f64; 2]| {
            let (of, wide) = (&mut robot.joints[joint], &wide[joint]);
            let scaled =
                |share: f64, limit: f64| wide.nominal_rad + share * (limit - wide.nominal_rad);
            of.position_min_rad = scaled(lower, wide.position_min_rad);
            of.position_max_rad = scaled(upper, wide.position_max_rad);
        };
        let shares: Vec<_> = (0..SHARES).map(|power| SHARE.powi(power)).collect();
        let fitting = shares.iter().position(|&share| {
            path.iter().for_each(|&joint| set(&mut robot, joint, [share; 2]));
            closes(&robot, &crank)
        });
        // The rules name a linkage that does not close.
        let Some(fitting) = fitting else {
            robot.joints = wide;
            continue;
        };
        if fitting == 0 {
            continue;
        }
        // One end after the other may be wider than all ends together.
        for &joint in &path {
            let mut own = [shares[fitting]; 2];
            for end in 0..2 {
                let wider = shares[..fitting].iter().find(|&&share| {
                    let mut trial = own;
                    trial[end] = share;
                    set(&mut robot, joint, trial);
                    closes(&robot, &crank)
                });
                own[end] = wider.copied().unwrap_or(own[end]);
                set(&mut robot, joint, own);
            }
            if own != [1.0; 2] {
                narrowed.push(joint);
            }
        }
    }
    narrowed.sort_unstable();
    narrowed.dedup();
    for &index in &narrowed {
        let Joint { position_min_rad, position_max_rad, .. } = robot.joints[index];
        joints[index].range.min_rad = position_min_rad;
        joints[index].range.max_rad = position_max_rad;
    }
    narrowed
}

/// True if a linkage keeps a little more than the margin of the rules in all poses.
fn closes(robot: &Robot, crank: &CrankMap) -> bool {
    let mut closes = true;
    crank.for_each_pose(robot, |joint_rad| {
        closes = crank.state(joint_rad).sines.iter().all(|sine| sine.abs() > 1.001 * SINE_MIN);
        closes
    });
    closes
}

/// Robot with the joints of a draft, without masses and motors.
fn skeleton(joints: &[DraftJoint]) -> Robot {
    let actuator = Actuator {
        model: String::new(),
        speed_max_rad_s: 0.0,
        torque_max_nm: 0.0,
        torque_speed: None,
        kp_nm_rad: 0.0,
        kd_nm_s_rad: 0.0,
        armature_kg_m2: 0.0,
        bus: 0,
        id: 0,
    };
    let linkage = |of: &DraftLinkage| crate::Linkage {
        link: of.link,
        pivot_in_link_m: of.pivot_m,
        pin_in_link_m: of.pin_m,
        axis_in_link: of.axis,
        rod_in_child_m: of.rod_end_m,
        nominal_rad: of.nominal_rad,
    };
    let joint = |of: &DraftJoint| Joint {
        name: of.name.clone(),
        parent: of.parent,
        child: of.child,
        parent_from_joint: of.parent_from_joint,
        axis_in_joint: of.axis,
        travel_m_per_rad: of.travel_m_per_rad,
        position_min_rad: of.range.min_rad,
        position_max_rad: of.range.max_rad,
        nominal_rad: of.range.nominal_rad,
        actuator: actuator.clone(),
        motor_per_joint: Vec::new(),
        linkage: of.linkage.as_ref().map(linkage),
        spring: None,
    };
    Robot {
        name: String::new(),
        links: Vec::new(),
        joints: joints.iter().map(joint).collect(),
        end_effectors: Vec::new(),
        buses: BTreeMap::new(),
        clearance_margin_m: 0.0,
    }
}
