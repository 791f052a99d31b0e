//! Static equilibrium of passive joints: angles at which their springs carry the standing robot while motors hold all other
//! joints at their nominal angles.

use crate::{CompositeInertia, Standing, Tree};
use nalgebra::{DMatrix, DVector};
use rollwalk_robot::Robot;
use std::f64::consts::TAU;

/// Step of the finite differences of torques, rad.
const STEP_RAD: f64 = 1e-5;
/// Maximum number of Newton steps, and their largest change of an angle, rad.
const STEPS: usize = 60;
const LARGEST_RAD: f64 = 0.2;
/// Change of an angle at which it has converged, rad.
const CONVERGED_RAD: f64 = 1e-9;

/// Passive joint of the standing robot.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PassiveLoad {
    /// Index of the joint.
    pub joint: usize,
    /// Torque of the spring that would balance the robot in the nominal pose, N·m.
    pub nominal_nm: f64,
    /// Angle of the joint in static equilibrium, rad. `None` if the spring is too soft: the joint turns to a limit.
    pub stands_at_rad: Option<f64>,
    /// Smallest stiffness with a stable equilibrium in the nominal pose, N·m/rad: the decrease of the load per angle.
    pub stable_nm_rad: f64,
    /// Natural frequency of the links beyond the joint on its spring, with the rest of the robot held, Hz.
    pub natural_hz: f64,
    /// Damping ratio of this oscillation; 1 is critical.
    pub damping_ratio: f64,
}

/// Passive joints of a robot at rest in its nominal pose, in joint order.
pub fn passive_loads(tree: &Tree, standing: &Standing) -> Vec<PassiveLoad> {
    let robot = tree.robot();
    let passive: Vec<usize> =
        (0..robot.joints.len()).filter(|&joint| robot.joints[joint].is_passive()).collect();
    if passive.is_empty() {
        return Vec::new();
    }
    let nominal = DVector::from_iterator(
        passive.len(),
        passive.iter().map(|&joint| robot.joints[joint].nominal_rad),
    );
    let here = unbalanced_nm(robot, &passive, &nominal);
    let slopes = here.as_ref().and_then(|here| slopes(robot, &passive, &nominal, here));
    let equilibrium = equilibrium(robot, &passive, nominal.clone());
    let composite = CompositeInertia::new(tree, &standing.frames);
    let load = |(k, &joint): (usize, &usize)| {
        let spring = robot.joints[joint].spring.unwrap_or_default();
        let stiffness_nm_rad = spring.stiffness_nm_rad;
        let inertia_kg_m2 = composite.joint_inertia(tree, &standing.frames, joint);
        let rate_rad_s = (stiffness_nm_rad / inertia_kg_m2).sqrt();
        let slope = slopes.as_ref().map_or(stiffness_nm_rad, |slopes| slopes[(k, k)]);
        PassiveLoad {
            joint,
            nominal_nm: standing.torque_nm[joint] + spring.torque_nm(nominal[k], 0.0),
            stands_at_rad: equilibrium.as_ref().map(|angles| angles[k]),
            stable_nm_rad: (stiffness_nm_rad - slope).max(0.0),
            natural_hz: rate_rad_s / TAU,
            damping_ratio: 0.5 * spring.damping_nm_s_rad / (inertia_kg_m2 * rate_rad_s),
        }
    };
    passive.iter().enumerate().map(load).collect()
}

/// Torques that motors of the passive joints would need beside the springs, N·m, at their angles.
fn unbalanced_nm(robot: &Robot, passive: &[usize], angles: &DVector<f64>) -> Option<DVector<f64>> {
    let mut robot = robot.clone();
    for (&joint, angle) in passive.iter().zip(angles) {
        robot.joints[joint].nominal_rad = *angle;
    }
    let torques = Standing::new(&Tree::new(&robot))?.torque_nm;
    Some(DVector::from_iterator(passive.len(), passive.iter().map(|&joint| torques[joint])))
}

/// Derivatives of these torques with respect to the angles, N·m/rad.
fn slopes(
    robot: &Robot,
    passive: &[usize],
    angles: &DVector<f64>,
    here: &DVector<f64>,
) -> Option<DMatrix<f64>> {
    let mut slopes = DMatrix::zeros(passive.len(), passive.len());
    for k in 0..passive.len() {
        let mut moved = angles.clone();
        moved[k] += STEP_RAD;
        let there = unbalanced_nm(robot, passive, &moved)?;
        slopes.set_column(k, &((there - here) / STEP_RAD));
    }
    Some(slopes)
}

/// Angles without unbalanced torques, within the limits of the joints. `None` without a stable equilibrium.
fn equilibrium(robot: &Robot, passive: &[usize], mut angles: DVector<f64>) -> Option<DVector<f64>> {
    for _ in 0..STEPS {
        let here = unbalanced_nm(robot, passive, &angles)?;
        let slopes = slopes(robot, passive, &angles, &here)?;
        if slopes.diagonal().iter().any(|slope| *slope <= 0.0) {
            return None;
        }
        let step = slopes.lu().solve(&-here)?;
        angles += step.map(|step| step.clamp(-LARGEST_RAD, LARGEST_RAD));
        let outside = |(&joint, angle): (&usize, &f64)| {
            let of = &robot.joints[joint];
            !(of.position_min_rad..=of.position_max_rad).contains(angle)
        };
        if passive.iter().zip(&angles).any(outside) {
            return None;
        }
        if step.amax() < CONVERGED_RAD {
            return Some(angles);
        }
    }
    None
}
