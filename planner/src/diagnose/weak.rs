//! Detection of motors that are too weak for standing in the posture of the motion. A diagnosis names them before all other
//! causes.
//!
//! The point with the least violation does not show such motors. There, other constraints are violated instead, such as limits
//! of joints in stretched legs.

use crate::families::Family;
use crate::plan::Culprit;
use crate::problem::Problem;
use rollwalk_multibody::euler::JOINTS;
use rollwalk_multibody::{Standing, Tree};

/// Torque of the first trial, as a multiple of the torque for standing. A walk lifts one of four legs.
const FOR_MOTION: f64 = 1.5;

/// Returns the joint with the weakest motor in relation to the torque for standing on all feet in the motion's posture. `None`
/// if all motors can bear the robot, or if the posture is not balanced.
pub(super) fn too_weak_to_stand(problem: &Problem) -> Option<Culprit> {
    let mut robot = problem.model.robot().clone();
    for (joint, angle) in robot.joints.iter_mut().zip(problem.posture_q[0].iter().skip(JOINTS)) {
        joint.nominal_rad = *angle;
    }
    let standing = Standing::new(&Tree::new(&robot)).filter(|standing| standing.balanced)?;
    let needed = standing.torque_nm.iter().map(|torque_nm| torque_nm.abs());
    let driven = robot.joints.iter().zip(needed).filter(|(joint, _)| !joint.is_passive());
    let (joint, needed_nm) = driven.max_by(|(one, a), (other, b)| {
        let share = |torque_nm: f64, limit_nm: f64| torque_nm / limit_nm;
        share(*a, one.actuator.torque_max_nm).total_cmp(&share(*b, other.actuator.torque_max_nm))
    })?;
    let limit_nm = joint.actuator.torque_max_nm;
    let family = Family::JointTorque;
    (needed_nm > limit_nm).then(|| Culprit {
        constraint: family,
        part: family.kind(),
        subject: Some(joint.name.clone()),
        time_s: [0.0, problem.interval_s * (problem.last() - 1) as f64],
        worst: needed_nm - limit_nm,
        unit: family.unit().symbol().to_owned(),
        share: 1.0,
        field: Some("torque_max_nm".to_owned()),
        given: Some(limit_nm),
        would_do: Some(FOR_MOTION * needed_nm / problem.reserve.torque_use),
        advice: format!("{} (standing alone requires {needed_nm:.2} N·m)", family.advice()),
    })
}
