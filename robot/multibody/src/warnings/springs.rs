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
        // A prismatic joint has metres and newtons.
        let per_rad = joint.per_rad();
        let [stiffness_key, stiffness_unit, rest_key, unit, nominal_key] =
            match joint.is_prismatic() {
                true => ["stiffness_n_m", "N/m", "rest_m", "m", "nominal_m"],
                false => ["stiffness_nm_rad", "N·m/rad", "rest_rad", "rad", "nominal_rad"],
            };
        let per_square = per_rad * per_rad;
        let rest = (joint.nominal_rad + load.nominal_nm / spring.stiffness_nm_rad) * per_rad;
        let text = match load.stands_at_rad {
            None if spring.stiffness_nm_rad < RESERVE * load.stable_nm_rad => format!(
                "`{stiffness_key}` is {}, too soft to stand: the load grows by {:.2} {stiffness_unit} as the joint yields; give at \
                 least {:.2} {stiffness_unit}",
                spring.stiffness_nm_rad / per_square,
                load.stable_nm_rad / per_square,
                RESERVE * load.stable_nm_rad / per_square
            ),
            None => format!(
                "its spring does not hold the standing robot within the limits of the joint; give `{rest_key}` = {rest:.3}, \
                 with which the robot stands in the nominal pose, or a larger `{stiffness_key}`"
            ),
            Some(at_rad) if (at_rad - joint.nominal_rad).abs() > OFF_MAX_RAD => format!(
                "the robot stands with the joint at {:.3} {unit}, not at `{nominal_key}` {}; give `{rest_key}` = {rest:.3}, \
                 or correct `{nominal_key}`",
                at_rad * per_rad,
                joint.nominal_rad * per_rad
            ),
            Some(_) => return None,
        };
        Some(RobotWarning::of("joint", &joint.name, text))
    };
    passive_loads(seen.tree, seen.standing).into_iter().filter_map(warning).collect()
}
