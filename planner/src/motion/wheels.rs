//! Actuated wheels that a motion holds still (the key `wheels` of motion files), and goals beyond the reach of held and welded
//! wheels.

use super::{Ends, Motion};
use rollwalk_robot::document::{Document, Table, alternatives};
use rollwalk_robot::{EndEffector, Robot};
use std::f64::consts::PI;

const KEY: &str = "wheels";

impl Motion {
    /// Flags of the end effectors whose wheel does not turn relative to its link. The wheel is welded to the link or held still
    /// by the motion.
    pub fn still_wheels(&self, robot: &Robot) -> Vec<bool> {
        let feet = robot.end_effectors.iter().zip(&self.held_wheels);
        feet.map(|(foot, &held)| held || foot.contact.rolls_with_link()).collect()
    }
}

/// Reads `wheels`: `"actuated"` (the default), `"held"`, or the names of the held wheels. Returns one flag for each end
/// effector.
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
            let help = "leave out `wheels`, because only wheels with a motor can be held";
            let problem =
                format!("is \"held\", but robot `{}` has no wheel with a motor", robot.name);
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

/// Refuses goals out of reach of a wheel that neither turns relative to its link nor leaves the ground. Such a wheel is a round
/// foot. It rolls only as its link pitches, at most half a turn, and rolls back within a period.
pub(super) fn check_reach(root: &Table<'_>, motion: &Motion, foot: &EndEffector, distance_m: f64) {
    let periodic = motion.ends == Ends::Periodic;
    let reach_m = if periodic { 0.0 } else { PI * foot.radius_m };
    let turns = periodic && motion.goal.turn_rad.is_some_and(|turn| turn != 0.0);
    if distance_m <= reach_m && !turns {
        return;
    }
    let problem = format!("cannot be reached: `{}` never leaves the ground", foot.name);
    let help = if periodic {
        "give this wheel a swing, or remove the goal: a held or welded wheel rolls back within a \
         period"
            .to_owned()
    } else {
        format!(
            "give this wheel a swing, or a goal within {reach_m:.2} m: a held or welded wheel \
             rolls only as its link pitches"
        )
    };
    root.fault("goal", problem, "requires a wheel that does not turn to move", help);
}
