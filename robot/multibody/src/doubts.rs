//! Doubts about a robot that breaks no rule: numbers that no robot of its size has, most of them slips of a unit or of a sign.
//!
//! Bounds lie far outside of what built robots have: each is a multiple of the extremes over the robots that ship and the
//! quadrupeds of big makers. A doubt names what is doubtful, the value, and the slip that would explain it.

mod limbs;
mod masses;
mod motors;
mod names;
mod seen;
mod wheels;

use crate::{Standing, Tree};
use seen::{Doubt, Seen};

/// Doubts about a robot in its nominal pose, a sentence each, what spoils most numbers first.
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
