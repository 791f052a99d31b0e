//! Footfalls of transitions for which the library file gives none. An end effector that a motor cannot roll to its next contact
//! point steps there.
//!
//! Feet that neither motion lifts stay in place. A foot, free wheel or skate that one of the two motions lifts generally stands
//! at different points in the two motions, and therefore steps once. Steps follow each other in the order in which the gait
//! lifts the end effectors.

use super::LibraryFile;
use crate::motion::Motion;
use rollwalk_robot::Robot;
use std::collections::BTreeSet;

/// Minimum number of samples of a step.
const STEP_SAMPLES: usize = 5;
/// Number of samples of stance before the first step and after the final one.
const STANCE_SAMPLES: usize = 2;

impl LibraryFile {
    /// Adds footfalls to the transitions that lack them. `motions` must have been read from the files that
    /// [`LibraryFile::motions`] names, in that order.
    #[must_use]
    pub fn stepping(mut self, robot: &Robot, motions: &[Motion]) -> Self {
        for transition in self.transitions.iter_mut().filter(|of| of.footfalls_open) {
            let ends = [transition.from, transition.to].map(|index| motions.get(index));
            if let [Some(from), Some(to)] = ends {
                step(&mut transition.motion, from, to, robot);
            }
        }
        self
    }
}

/// First sample at which an end effector is lifted, in the first of `motions` that lifts it. `None` if no motion lifts it, or
/// if it is a wheel with a motor.
fn lifted(robot: &Robot, foot: usize, motions: &[&Motion]) -> Option<usize> {
    let stays = robot.end_effectors[foot].contact.actuator().is_some();
    let lifted = |motion: &&Motion| motion.stance.iter().position(|row| !row[foot]);
    if stays { None } else { motions.iter().find_map(lifted) }
}

/// Returns the number of steps in transitions between motions. End effectors of one link step together, if at least one of the
/// motions lifts them.
pub fn count_of_steps(robot: &Robot, motions: &[&Motion]) -> usize {
    let feet = robot.end_effectors.iter().enumerate();
    let stepping = feet.filter(|(foot, _)| lifted(robot, *foot, motions).is_some());
    stepping.map(|(_, of)| of.link).collect::<BTreeSet<_>>().len()
}

/// Adds the steps from one motion to another to a transition.
fn step(transition: &mut Motion, from: &Motion, to: &Motion, robot: &Robot) {
    // Lift-off times of a gait, and the end effectors of one link, which step together.
    let mut steps: Vec<(usize, Vec<usize>)> = Vec::new();
    for (foot, of) in robot.end_effectors.iter().enumerate() {
        let Some(when) = lifted(robot, foot, &[to, from]) else { continue };
        let same_link = |feet: &[usize]| robot.end_effectors[feet[0]].link == of.link;
        match steps.iter_mut().find(|(_, feet)| same_link(feet)) {
            Some((first, feet)) => {
                *first = when.min(*first);
                feet.push(foot);
            }
            None => steps.push((when, vec![foot])),
        }
    }
    if steps.is_empty() {
        return;
    }
    steps.sort_unstable();
    let samples = transition.stance.len().max(steps.len() * STEP_SAMPLES + 2 * STANCE_SAMPLES);
    let length = (samples - 2 * STANCE_SAMPLES) / steps.len();
    transition.stance = vec![vec![true; robot.end_effectors.len()]; samples];
    for (k, (_, feet)) in steps.into_iter().enumerate() {
        let begin = STANCE_SAMPLES + k * length;
        for row in &mut transition.stance[begin..begin + length] {
            feet.iter().for_each(|&foot| row[foot] = false);
        }
    }
    if transition.swing_height_m <= 0.0 {
        transition.swing_height_m = from.swing_height_m.max(to.swing_height_m);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::motion::Ends;
    use crate::test_robots;

    #[test]
    fn contacts_of_one_foot_take_one_step() {
        let mut robot = test_robots::welded(&test_robots::all()[0]);
        let motion = test_robots::motion(&robot, Ends::AtRest);
        assert_eq!(count_of_steps(&robot, &[&motion]), robot.end_effectors.len());
        robot.end_effectors[1].link = robot.end_effectors[0].link;
        assert_eq!(count_of_steps(&robot, &[&motion]), robot.end_effectors.len() - 1);
    }
}
