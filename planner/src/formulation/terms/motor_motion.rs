//! Angles and speeds of the motors of joints, and their derivatives. Motors of belts and differentials turn with several joints,
//! motors of linkages by a function of joint angles.

use crate::formulation::rows::{RowWriter, Window};
use rollwalk_multibody::euler::JOINTS;
use rollwalk_robot::{JointRatio, Ratios};

/// Ratios of all motors at sample `k` of a window.
pub(super) fn ratios<'w>(window: &'w Window<'_>, k: usize) -> &'w Ratios {
    window.states[k].pose.frames.ratios(window.problem.model.tree())
}

/// Mean speed of a motor between two samples of a window, rad/s.
pub(super) fn mean_speed(
    window: &Window,
    [from, to]: [usize; 2],
    motor: usize,
    duration_s: f64,
) -> f64 {
    let [first, last] = [from, to].map(|k| ratios(window, k));
    if let (Some(first_rad), Some(last_rad)) = (first.motor_rad(motor), last.motor_rad(motor)) {
        return (last_rad - first_rad) / duration_s;
    }
    let [first_vars, last_vars] = [from, to].map(|k| &window.states[k].vars);
    let speed = |of: &JointRatio| {
        let joint = JOINTS + of.joint;
        of.ratio * ((last_vars[joint] - first_vars[joint]) / duration_s)
    };
    first.ratios(motor).iter().map(speed).sum()
}

/// Adds `factor` times the derivative of a motor's rotation between two samples to the next row.
pub(super) fn differentiate(
    window: &Window,
    [from, to]: [usize; 2],
    motor: usize,
    factor: f64,
    out: &mut RowWriter,
) {
    for (k, factor) in [(from, -factor), (to, factor)] {
        for of in ratios(window, k).ratios(motor) {
            out.d(k, JOINTS + of.joint, of.ratio * factor);
        }
    }
}

/// Second difference of a motor's angle over the three samples of a window, rad, times `per_h2`.
pub(super) fn second_difference_rad(window: &Window, motor: usize, per_h2: f64) -> f64 {
    let of_pose = [0, 1, 2].map(|k| ratios(window, k));
    if let [Some(before), Some(here), Some(after)] = of_pose.map(|of| of.motor_rad(motor)) {
        return (before - 2.0 * here + after) * per_h2;
    }
    let bent = |of: &JointRatio| {
        let angles = window.states.map(|state| state.vars[JOINTS + of.joint]);
        of.ratio * ((angles[0] - 2.0 * angles[1] + angles[2]) * per_h2)
    };
    of_pose[1].ratios(motor).iter().map(bent).sum()
}
