//! Footfall patterns for one goal: the pattern of the motion file, rolling on all wheels, and the named gaits with several duty
//! factors.

use super::feet::gait_columns;
use super::footfall::GAITS;
use super::phases::{Swing, stance_of};
use super::{Ends, Motion};
use rollwalk_robot::Robot;
use std::fmt;

/// Duty factors of the gaits.
const DUTIES: [f64; 3] = [0.6, 0.7, 0.8];
/// Minimum number of samples of a swing.
const SWING_SAMPLES: f64 = 5.0;
/// Approximate duration of a cycle in a motion at rest at its ends, s.
const CYCLE_S: f64 = 1.0;
/// Swing height of a motion without one, as a fraction of the standing height.
const SWING_HEIGHT: f64 = 0.12;

/// Source of a pattern.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum PatternKind {
    /// Footfalls of the motion file.
    Given,
    /// Stance of all end effectors throughout.
    AllStance,
    /// Named gait with a duty factor.
    Gait {
        /// Name of the gait.
        name: &'static str,
        /// Duty factor.
        duty: f64,
        /// Number of cycles of a motion at rest at its ends.
        cycles: Option<u32>,
    },
}

/// Motion with one of several footfall patterns.
#[derive(Clone, Debug, PartialEq)]
pub struct Pattern {
    /// Source of the footfalls.
    pub kind: PatternKind,
    /// The motion.
    pub motion: Motion,
}

impl PatternKind {
    /// Keys of `[footfalls]` in a motion file that give this pattern; `None` for the pattern of the file.
    pub fn footfall_keys(&self) -> Option<String> {
        match self {
            Self::Given => None,
            Self::AllStance => Some("all = \"stance\"".into()),
            Self::Gait { name, duty, cycles } => {
                let cycles = cycles.map(|cycles| format!(", cycles = {cycles}"));
                Some(format!("gait = \"{name}\", duty = {duty}{}", cycles.unwrap_or_default()))
            }
        }
    }
}

impl fmt::Display for PatternKind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Given => f.write_str("as given"),
            Self::AllStance => f.write_str("all = \"stance\""),
            Self::Gait { name, duty, cycles: None } => write!(f, "{name}, duty {duty}"),
            Self::Gait { name, duty, cycles: Some(cycles) } => {
                write!(f, "{name}, duty {duty}, cycles {cycles}")
            }
        }
    }
}

impl Motion {
    /// Returns the motion with each footfall pattern that suits the robot: the given one first, then rolling on all wheels, then
    /// the named gaits. Patterns equal to an earlier one are left out. A motion with `lying` has only the given pattern.
    pub fn patterns(&self, robot: &Robot) -> Vec<Pattern> {
        let mut patterns = vec![Pattern { kind: PatternKind::Given, motion: self.clone() }];
        // The feet of a robot that lies rise with its body.
        if self.lying_rad.is_some() {
            return patterns;
        }
        let rolls = robot.end_effectors.iter().zip(self.still_wheels(robot));
        if rolls.clone().all(|(foot, still)| foot.contact.rolls() && !still) {
            let stance = vec![vec![true; robot.end_effectors.len()]; self.stance.len()];
            let motion = self.with_footfalls(stance, robot);
            patterns.push(Pattern { kind: PatternKind::AllStance, motion });
        }
        if let Some(feet) = gait_columns(robot) {
            for (name, centers) in GAITS {
                for duty in DUTIES {
                    let swing = |&row: &usize| Swing { center: centers[row], share: 1.0 - duty };
                    let swings: Vec<Swing> = feet.iter().map(swing).collect();
                    let (cycles, samples) = self.grid(duty);
                    let mut motion =
                        self.with_footfalls(stance_of(&swings, samples, cycles), robot);
                    if motion.swing_height_m == 0.0 {
                        motion.swing_height_m = usual_swing_height_m(robot);
                    }
                    patterns
                        .push(Pattern { kind: PatternKind::Gait { name, duty, cycles }, motion });
                }
            }
        }
        let mut different: Vec<Pattern> = Vec::new();
        for pattern in patterns {
            if different.iter().all(|other| other.motion != pattern.motion) {
                different.push(pattern);
            }
        }
        different
    }

    /// Number of cycles and samples of a gait, so that swings have enough samples.
    fn grid(&self, duty: f64) -> (Option<u32>, usize) {
        // A swing of n + 1 intervals contains only n samples if its ends lie on samples.
        let of_cycle = ((SWING_SAMPLES + 1.0) / (1.0 - duty)).ceil();
        let given = self.stance.len();
        if self.ends == Ends::Periodic {
            return (None, given.max(of_cycle as usize));
        }
        let cycles = (self.duration_s / CYCLE_S - 0.5).round().max(1.0);
        let samples = (of_cycle * (cycles + 0.5)) as usize + 1;
        (Some(cycles as u32), given.max(samples).min(super::file::SAMPLES_MAX as usize))
    }

    /// Returns the motion with other footfalls, whose sample count may differ.
    fn with_footfalls(&self, stance: Vec<Vec<bool>>, robot: &Robot) -> Self {
        let mut motion = self.with_stance(stance);
        if let (Some(terrain), Some(of)) = (self.ground.terrain(), &self.terrain) {
            motion.set_terrain(terrain.clone(), of.margins, robot);
        }
        motion
    }
}

fn usual_swing_height_m(robot: &Robot) -> f64 {
    // Whole millimetres, as a person would write it.
    (1e3 * SWING_HEIGHT * super::footing::standing_height_m(robot)).round() / 1e3
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_robots;

    #[test]
    fn patterns_of_a_walking_robot_have_whole_swings() {
        let robot = test_robots::all().swap_remove(0);
        for ends in [Ends::Periodic, Ends::AtRest] {
            let mut motion = test_robots::motion(&robot, ends);
            motion.duration_s = 2.0;
            motion.stance = vec![vec![true; 4]; 24];
            motion.swing_height_m = 0.0;
            let patterns = motion.patterns(&robot);
            // All feet stand already, so that rolling is the given pattern.
            assert_eq!(patterns.len(), 1 + 5 * DUTIES.len());
            assert_eq!(patterns[0].kind.to_string(), "as given");
            let cycles = if ends == Ends::Periodic { "" } else { ", cycles = 2" };
            assert_eq!(
                patterns[1].kind.footfall_keys(),
                Some(format!("gait = \"{}\", duty = 0.6{cycles}", GAITS[0].0))
            );
            for pattern in &patterns[1..] {
                let stance = &pattern.motion.stance;
                assert!(pattern.motion.swing_height_m > 0.01, "{}", pattern.kind);
                let column: Vec<bool> = stance.iter().map(|feet| feet[0]).collect();
                let start = column.iter().position(|down| *down).expect("a stance");
                let order: Vec<bool> =
                    column.iter().cycle().skip(start).take(column.len()).copied().collect();
                let runs = order.split(|down| *down).map(<[bool]>::len).filter(|run| *run > 0);
                assert!(runs.min() >= Some(5), "{}: {column:?}", pattern.kind);
            }
        }
    }
}
