//! Warnings about a valid robot with implausible values, most of them errors of a unit or a sign.
//!
//! Limits are far outside the range of real robots: multiples of the extremes over the shipped robots and commercial
//! quadrupeds. A warning contains the item, its value, and the probable error.

mod limbs;
mod masses;
mod motors;
mod names;
mod springs;
mod warning;
mod wheels;

use crate::{Standing, Tree};
use warning::{CheckedRobot, RobotWarning};

/// Warnings about a robot in its nominal pose, one sentence each. The order is masses, motors, springs, limbs,
/// wheels, names.
pub fn warnings(tree: &Tree, standing: &Standing) -> Vec<String> {
    let seen = CheckedRobot::new(tree, standing);
    let all = [
        masses::warnings,
        motors::warnings,
        springs::warnings,
        limbs::warnings,
        wheels::warnings,
        names::warnings,
    ];
    let mut warnings: Vec<RobotWarning> = Vec::new();
    for warning in all.iter().flat_map(|of| of(&seen)) {
        // Limbs of a template share its mistakes.
        match warnings.iter_mut().find(|of| (of.kind, &of.text) == (warning.kind, &warning.text)) {
            Some(same) => same.names.extend(warning.names),
            None => warnings.push(warning),
        }
    }
    warnings.iter().map(RobotWarning::to_string).collect()
}

#[cfg(test)]
mod tests;
