//! Warnings about springs of passive joints that do not carry the standing robot in its nominal pose.

use super::warning::{CheckedRobot, RobotWarning};
use crate::passive::{PassiveLoad, passive_loads};

/// Largest deviation of the equilibrium of a passive joint from its nominal angle, rad.
const OFF_MAX_RAD: f64 = 0.02;
/// Ratio of the suggested stiffness to the smallest one with a stable equilibrium.
const RESERVE: f64 = 2.0;

pub(super) fn warnings(seen: &CheckedRobot<'_>) -> Vec<RobotWarning> {
    let robot = seen.tree.robot();
    let warning = |load: PassiveLoad| {
        let joint = &robot.joints[load.joint];
        let spring = joint.spring.unwrap_or_default();
        let rest_rad = joint.nominal_rad + load.nominal_nm / spring.stiffness_nm_rad;
        let text = match load.stands_at_rad {
            None if spring.stiffness_nm_rad < RESERVE * load.stable_nm_rad => format!(
                "`stiffness_nm_rad` is {}, too soft to stand: the load grows by {:.2} N·m/rad as the joint yields; give at \
                 least {:.2} N·m/rad",
                spring.stiffness_nm_rad,
                load.stable_nm_rad,
                RESERVE * load.stable_nm_rad
            ),
            None => format!(
                "its spring does not hold the standing robot within the limits of the joint; give `rest_rad` = {rest_rad:.3}, \
                 with which the robot stands in the nominal pose, or a larger `stiffness_nm_rad`"
            ),
            Some(at_rad) if (at_rad - joint.nominal_rad).abs() > OFF_MAX_RAD => format!(
                "the robot stands with the joint at {at_rad:.3} rad, not at `nominal_rad` {}; give `rest_rad` = {rest_rad:.3}, \
                 or correct `nominal_rad`",
                joint.nominal_rad
            ),
            Some(_) => return None,
        };
        Some(RobotWarning::of("joint", &joint.name, text))
    };
    passive_loads(seen.tree, seen.standing).into_iter().filter_map(warning).collect()
}
