//! Footfalls of transitions that the library file leaves open: what cannot roll to where the next motion needs it steps there.
//!
//! Between motions that keep them down, feet stay where they are. A foot or skate that one of the two motions lifts stands
//! elsewhere in each of them, in general: it steps once, one after the other, in the order in which the gait lifts them.

use super::LibraryFile;
use crate::motion::Motion;
use rollwalk_robot::Robot;

/// Samples of a step, at least, and of the stance before the first and after the last one.
const STEP_SAMPLES: usize = 5;
const STANCE_SAMPLES: usize = 2;

impl LibraryFile {
    /// Completes the transitions without footfalls of their own for the motions that they join, which are read from the files that
    /// [`LibraryFile::motions`] names and in that order.
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

/// Gives a transition the steps that lead from one motion to another.
fn step(transition: &mut Motion, from: &Motion, to: &Motion, robot: &Robot) {
    // By when the gait lifts it; that of the motion which is entered, if both do.
    let lifted = |motion: &Motion, foot: usize| motion.stance.iter().position(|row| !row[foot]);
    let feet = robot.end_effectors.iter().enumerate().filter(|(_, foot)| !foot.contact.spins());
    let mut steps: Vec<(usize, usize)> = feet
        .filter_map(|(foot, _)| Some((lifted(to, foot).or_else(|| lifted(from, foot))?, foot)))
        .collect();
    if steps.is_empty() {
        return;
    }
    steps.sort_unstable();
    let samples = transition.stance.len().max(steps.len() * STEP_SAMPLES + 2 * STANCE_SAMPLES);
    let length = (samples - 2 * STANCE_SAMPLES) / steps.len();
    transition.stance = vec![vec![true; robot.end_effectors.len()]; samples];
    for (k, (_, foot)) in steps.into_iter().enumerate() {
        let begin = STANCE_SAMPLES + k * length;
        transition.stance[begin..begin + length].iter_mut().for_each(|row| row[foot] = false);
    }
    if transition.swing_height_m <= 0.0 {
        transition.swing_height_m = from.swing_height_m.max(to.swing_height_m);
    }
}
