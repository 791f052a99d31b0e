//! Motions with half the samples, whose plans serve as starts.
//!
//! With few samples, the solver finds a stroke of skates or a swizzle. With many, its steps from standing are too short for a
//! stroke, because costs and constraints tie every sample to its neighbours. Resampled to twice the samples, the coarse plan is
//! nearly feasible, and a few Gauss-Newton steps complete the solve.

use super::skates;
use crate::motion::{Ends, Motion, Subject};
use rollwalk_robot::Robot;

/// Sample count up to which a motion is not halved.
const FEW: usize = 32;
/// Sample count up to which a motion on skates is not halved.
const FEW_ON_SKATES: usize = 12;
/// Minimum number of samples of a swing.
const LEAST_SWING: usize = 3;

/// Returns the motion with half the samples. `None` for transitions, if the samples are already few, if the footfalls would
/// change or swings be too short, or if a target sets the height of a swing.
pub fn halved(robot: &Robot, motion: &Motion) -> Option<Motion> {
    let samples = motion.stance.len();
    let few = if skates(robot, motion) { FEW_ON_SKATES } else { FEW };
    if samples <= few || motion.ends == Ends::Prescribed {
        return None;
    }
    let count = samples.div_ceil(2);
    let intervals =
        |samples: usize| if motion.ends == Ends::Periodic { samples } else { samples - 1 };
    let fine = |i: usize| {
        let at = i as f64 * intervals(samples) as f64 / intervals(count) as f64;
        (at.round() as usize).min(samples - 1)
    };
    let stance: Vec<Vec<bool>> = (0..count).map(|i| motion.stance[fine(i)].clone()).collect();
    let feet = 0..motion.stance[0].len();
    let swings_last = feet.clone().all(|j| shortest_swing(&stance, j) >= LEAST_SWING);
    // The number of swings stays the same: no swing is lost or merged with the next.
    let as_many = feet.clone().all(|j| swings(&stance, j) == swings(&motion.stance, j));
    // A target that sets the height of a swing has to stay within that swing.
    let shaped = motion.targets.iter().any(|target| {
        matches!(target.of, Subject::EndEffector(_)) && target.position_m[2].is_some()
    });
    (swings_last && as_many && !shaped).then(|| Motion { stance, ..motion.clone() })
}

/// Lengths of the swings of foot `j`, in samples. A swing across the end of the period counts as two.
fn swing_lengths(stance: &[Vec<bool>], j: usize) -> Vec<usize> {
    let flags: Vec<bool> = stance.iter().map(|feet| feet[j]).collect();
    flags.split(|&stands| stands).map(<[bool]>::len).filter(|&length| length > 0).collect()
}

fn swings(stance: &[Vec<bool>], j: usize) -> usize {
    swing_lengths(stance, j).len()
}

fn shortest_swing(stance: &[Vec<bool>], j: usize) -> usize {
    swing_lengths(stance, j).into_iter().min().unwrap_or(usize::MAX)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_robots;

    fn walking(flags: &str) -> (Robot, Motion) {
        let robot = test_robots::all().swap_remove(0);
        let mut motion = test_robots::motion(&robot, Ends::Periodic);
        let feet = robot.end_effectors.len();
        motion.stance =
            flags.chars().map(|c| (0..feet).map(|j| j > 0 || c == '#').collect()).collect();
        motion.targets.clear();
        (robot, motion)
    }

    #[test]
    fn halving_keeps_duration_and_swings() {
        let (robot, fine) = walking("######........##########################");
        let coarse = halved(&robot, &fine).expect("swings are long enough");
        assert_eq!(coarse.stance.len(), 20);
        assert_eq!(coarse.duration_s, fine.duration_s);
        assert_eq!(swing_lengths(&coarse.stance, 0), [4]);
        assert!(halved(&robot, &coarse).is_none(), "few samples are not halved");
    }

    #[test]
    fn short_swings_are_not_halved() {
        // Every second sample misses the single sample of stance between the two swings of the second foot.
        for flags in
            ["######...###############################", "#######........#........################"]
        {
            let (robot, motion) = walking(flags);
            assert!(halved(&robot, &motion).is_none());
        }
    }
}
