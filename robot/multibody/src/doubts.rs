//! Warnings about a valid robot with implausible values, most of them errors of a unit or a sign.
//!
//! Limits are far outside the range of real robots: multiples of the extremes over the shipped robots and commercial
//! quadrupeds. A warning contains the item, its value, and the probable error.

mod limbs;
mod masses;
mod motors;
mod names;
mod seen;
mod wheels;

use crate::{Standing, Tree};
use seen::{Doubt, Seen};

/// Warnings about a robot in its nominal pose, one sentence each. The order is masses, motors, limbs, wheels, names.
pub fn doubts(tree: &Tree, standing: &Standing) -> Vec<String> {
    let seen = Seen::new(tree, standing);
    let all = [masses::doubts, motors::doubts, limbs::doubts, wheels::doubts, names::doubts];
    let mut doubts: Vec<Doubt> = Vec::new();
    for doubt in all.iter().flat_map(|of| of(&seen)) {
        // Limbs of a template share its slips.
        match doubts.iter_mut().find(|of| (of.kind, &of.text) == (doubt.kind, &doubt.text)) {
            Some(same) => same.names.extend(doubt.names),
            None => doubts.push(doubt),
        }
    }
    doubts.iter().map(Doubt::to_string).collect()
}

#[cfg(test)]
mod tests;
