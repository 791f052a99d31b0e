//! Actuated wheels that a motion holds still (the key `wheels` of motion files), and goals beyond the reach of held and
//! welded wheels.

use super::{Ends, Motion};
use rollwalk_robot::document::{Document, Table, alternatives};
use rollwalk_robot::{EndEffector, Robot};
use std::f64::consts::PI;

const KEY: &str = "wheels";

impl Motion {
    /// Flags of the end effectors with a wheel that does not turn relative to its link: welded to it, or held still
    /// by the motion.
    pub fn still_wheels(&self, robot: &Robot) -> Vec<bool> {
        let feet = robot.end_effectors.iter().zip(&self.held_wheels);
        feet.map(|(foot, &held)| held || foot.contact.rolls_with_link()).collect()
    }
}

/// Reads `wheels`, which is `"actuated"` (the default), `"held"`, or the names of the held wheels; returns one flag for
/// each end effector.
pub(super) fn held(document: &Document<'_>, table: &Table<'_>, robot: &Robot) -> Option<Vec<bool>> {
    let feet = &robot.end_effectors;
    if !table.has(KEY) {
        return Some(vec![false; feet.len()]);
    }
    if table.is_array(KEY) {
        return named(document, table, robot);
    }
    let driven: Vec<bool> = feet.iter().map(is_driven).collect();
    match table.choice(KEY, &["actuated", "held"])? {
        0 => Some(vec![false; feet.len()]),
        _ if driven.contains(&true) => Some(driven),
        _ => {
            let help = "only wheels with a motor can be held: leave `wheels` out";
            let problem = format!("are to be held, but robot `{}` drives none", robot.name);
            table.fault(KEY, problem, "no actuated wheel", help);
            None
        }
    }
}

fn named(document: &Document<'_>, table: &Table<'_>, robot: &Robot) -> Option<Vec<bool>> {
    let mut held = vec![false; robot.end_effectors.len()];
    let mut sound = true;
    for (name, span) in table.strings(KEY)? {
        let driven = robot.end_effectors.iter().filter(|foot| is_driven(foot));
        match robot.end_effector_index(name).filter(|&j| is_driven(&robot.end_effectors[j])) {
            Some(index) => held[index] = true,
            None => {
                let message =
                    format!("wheels: robot `{}` has no actuated wheel `{name}`", robot.name);
                let help = alternatives(name, driven.map(|foot| foot.name.as_str()));
                document.fault(span, message, "no actuated wheel", help);
                sound = false;
            }
        }
    }
    sound.then_some(held)
}

fn is_driven(foot: &EndEffector) -> bool {
    foot.contact.actuator().is_some()
}

/// Rejects goals out of reach of a wheel that neither turns relative to its link nor leaves the ground. It is a round
/// foot: it rolls only as its link pitches, at most half a turn, and back again within a period.
pub(super) fn check_reach(root: &Table<'_>, motion: &Motion, foot: &EndEffector, distance_m: f64) {
    let periodic = motion.ends == Ends::Periodic;
    let reach_m = if periodic { 0.0 } else { PI * foot.radius_m };
    let turns = periodic && motion.goal.turn_rad.is_some_and(|turn| turn != 0.0);
    if distance_m <= reach_m && !turns {
        return;
    }
    let problem = format!("cannot be reached: `{}` never leaves the ground", foot.name);
    let help = if periodic {
        "a wheel that is held or welded rolls back within a period: give it a swing, or drop the goal"
            .to_owned()
    } else {
        format!(
            "a wheel that is held or welded rolls only as its link pitches, here {reach_m:.2} m at \
             most: give it a swing, or ask for less"
        )
    };
    root.fault("goal", problem, "moves a wheel that does not turn", help);
}
