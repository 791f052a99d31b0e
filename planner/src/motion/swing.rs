//! Heights of end effectors in swing: a smooth profile from lift-off to touch-down (Eq. 2.9).
//!
//! The thesis requires a constant height in swing. The profile w_h·sin²(πu) transfers better to real servos, because the
//! vertical speed is zero at lift-off and touch-down. u is 0 at the first sample of a swing and 1 at its last. The force of a
//! foot decreases linearly to zero at the first sample, and a foot off the ground cannot exert it. With a profile from the last
//! stance sample to the next one, walks on held wheels covered 96.0 % of their distance instead of 100.2 %. Swings of fewer
//! than five samples have that longer profile. A height target of an end effector scales the profile of its swing, so that the
//! profile passes through the target.

use super::{Ends, Moment, Motion, Subject};
use std::f64::consts::PI;

/// Minimum number of samples above the ground in a swing whose first and last sample are on the ground.
const LEAST_SWING: isize = 3;

/// Contact heights along a timeline, `[timeline sample][end effector]`, m. `timeline` contains the slot of each timeline
/// sample, and `slot_stance` the contact flags of the slots. In a periodic motion, a swing may continue across the end of the
/// period.
pub fn heights(timeline: &[usize], slot_stance: &[Vec<bool>], motion: &Motion) -> Vec<Vec<f64>> {
    let periodic = motion.ends == Ends::Periodic;
    let mut heights = profiles(timeline, slot_stance, periodic, motion.swing_height_m);
    for target in &motion.targets {
        let (Subject::EndEffector(j), Some(wanted_m)) = (target.of, target.position_m[2]) else {
            continue;
        };
        let moment = Moment::of(motion, target.at_s);
        let reached_m = at(&heights, moment, j);
        if reached_m > 0.0 {
            let in_swing = |t: usize| !slot_stance[timeline[t]][j];
            for t in swing_around(moment.nearest(motion) + 1, timeline.len(), periodic, in_swing) {
                heights[t][j] *= wanted_m / reached_m;
            }
        }
    }
    heights
}

/// Height of end effector `j` of a motion at a time on the grid, m.
pub fn height_at(motion: &Motion, j: usize, moment: Moment) -> f64 {
    let last = motion.stance.len() - 1;
    let (before, after) = if motion.ends == Ends::Periodic { (last, 0) } else { (0, last) };
    let timeline: Vec<usize> = std::iter::once(before).chain(0..=last).chain([after]).collect();
    at(&heights(&timeline, &motion.stance, motion), moment, j)
}

/// Height of end effector `j` at a time on the grid, interpolated between timeline samples, m.
fn at(heights: &[Vec<f64>], moment: Moment, j: usize) -> f64 {
    let weights = moment.position_weights();
    (0..3).map(|k| weights[k] * heights[moment.sample + k][j]).sum()
}

/// Timeline indices of the swing around index `middle`; empty if `middle` is in stance. In a periodic motion, a swing may
/// continue across the end of the period. The indices before and after the period repeat its last and first sample.
fn swing_around(
    middle: usize,
    len: usize,
    periodic: bool,
    in_swing: impl Fn(usize) -> bool,
) -> Vec<usize> {
    let mut found = vec![false; len];
    let samples = len - 2;
    let neighbour = |t: usize, step: usize| {
        if periodic {
            Some((t - 1 + step) % samples + 1)
        } else if step == 1 {
            Some(t + 1).filter(|&t| t < len)
        } else {
            t.checked_sub(1)
        }
    };
    for step in [1, samples - 1] {
        let mut next = Some(middle);
        while let Some(t) = next.filter(|&t| in_swing(t) && (t == middle || !found[t])) {
            found[t] = true;
            next = neighbour(t, step);
        }
    }
    if periodic {
        (found[0], found[len - 1]) = (found[samples], found[1]);
    }
    (0..len).filter(|&t| found[t]).collect()
}

/// Contact heights of swings, `[sample][end effector]`, m. The rows begin before a lift-off and end after a landing.
pub fn arches(stance: &[Vec<bool>], swing_height_m: f64) -> Vec<Vec<f64>> {
    profiles(&(0..stance.len()).collect::<Vec<_>>(), stance, false, swing_height_m)
}

/// Contact heights before targets scale them, `[timeline sample][end effector]`, m.
fn profiles(
    timeline: &[usize],
    slot_stance: &[Vec<bool>],
    periodic: bool,
    swing_height_m: f64,
) -> Vec<Vec<f64>> {
    let stance: Vec<&Vec<bool>> = timeline.iter().map(|&slot| &slot_stance[slot]).collect();
    let samples = timeline.len() - 2;
    // Stance of end effector j at a timeline index that may lie beyond the ends.
    let in_stance = |t: isize, j: usize| {
        let last = stance.len() as isize - 1;
        if periodic {
            stance[1 + (t - 1).rem_euclid(samples as isize) as usize][j]
        } else {
            stance[t.clamp(0, last) as usize][j]
        }
    };
    (0..stance.len() as isize)
        .map(|t| {
            (0..stance[0].len())
                .map(|j| {
                    if in_stance(t, j) {
                        return 0.0;
                    }
                    let reach = samples as isize + 2;
                    let to = |step: isize| (1..reach).find(|k| in_stance(t + step * k, j));
                    match (to(-1), to(1)) {
                        (Some(since), Some(until)) => {
                            let still = isize::from(since + until > LEAST_SWING + 2);
                            let (since, until) = (since - still, until - still);
                            let u = since as f64 / (since + until) as f64;
                            swing_height_m * (PI * u).sin().powi(2)
                        }
                        // Without stance before or after the swing the height is constant.
                        _ => swing_height_m,
                    }
                })
                .collect()
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_swing_across_the_seam_is_one_arch() {
        let stance: Vec<Vec<bool>> = [false, true, true, false].map(|c| vec![c]).to_vec();
        let heights = profiles(&[3, 0, 1, 2, 3, 0], &stance, true, 0.03);
        let column: Vec<f64> = heights.iter().map(|h| h[0]).collect();
        let expected = 0.03 * (PI / 3.0).sin().powi(2);
        for (height, expected) in
            column.iter().zip([expected, expected, 0.0, 0.0, expected, expected])
        {
            assert!((height - expected).abs() < 1e-15, "{column:?}");
        }
    }

    /// Heights of one end effector, m, in a motion that repeats its first and last sample beyond its ends.
    fn at_rest(stance: [bool; 5]) -> Vec<f64> {
        let stance: Vec<Vec<bool>> = stance.map(|down| vec![down]).to_vec();
        let heights = profiles(&[0, 0, 1, 2, 3, 4, 4], &stance, false, 0.03);
        heights.iter().map(|h| h[0]).collect()
    }

    #[test]
    fn a_swing_between_ends_at_rest_rises_to_the_swing_height_in_its_middle() {
        let heights = at_rest([true, false, false, false, true]);
        // sin²(π/4) is 1/2; the bound allows for rounding only.
        for (height, expected) in heights.iter().zip([0.0, 0.0, 0.5, 1.0, 0.5, 0.0, 0.0]) {
            assert!((height - 0.03 * expected).abs() < 1e-15, "{heights:?}");
        }
    }

    #[test]
    fn a_long_swing_is_on_the_ground_at_its_first_and_last_sample() {
        let stance: Vec<Vec<bool>> =
            [true, false, false, false, false, false, true].map(|down| vec![down]).to_vec();
        let heights = profiles(&[0, 0, 1, 2, 3, 4, 5, 6, 6], &stance, false, 0.03);
        for (height, expected) in heights.iter().zip([0.0, 0.0, 0.0, 0.5, 1.0, 0.5, 0.0, 0.0, 0.0])
        {
            assert!((height[0] - 0.03 * expected).abs() < 1e-15, "{heights:?}"); // rounding only
        }
    }

    #[test]
    fn a_swing_that_reaches_an_end_holds_its_height_there() {
        // At rest no foot touches down beyond the end, and no swing continues at the start.
        let heights = at_rest([true, true, false, false, false]);
        assert_eq!(heights, [0.0, 0.0, 0.0, 0.03, 0.03, 0.03, 0.03]);
        assert_eq!(at_rest([false; 5]), [0.03; 7]);
    }

    #[test]
    fn a_target_scales_its_swing_and_no_other() {
        let robot = &crate::test_robots::all()[0];
        for (ends, swings) in [
            // Periodic: one swing across the end of the period and one inside. At rest: two inside.
            (Ends::Periodic, [1, 0, 0, 1, 1, 0, 0, 0, 1, 1]),
            (Ends::AtRest, [0, 0, 0, 1, 1, 1, 0, 1, 1, 0]),
        ] {
            let mut motion = crate::test_robots::motion(robot, ends);
            motion.stance = swings.map(|swing| vec![swing == 0, true, true, true]).to_vec();
            let h = motion.interval_s();
            let problem = |motion: &Motion| {
                let model = rollwalk_multibody::euler::Model::new(robot);
                crate::problem::Problem::new(model, motion, Default::default()).height_m
            };
            let plain = problem(&motion);
            let at_s = 8.4 * h;
            motion.targets.push(crate::motion::Target {
                of: Subject::EndEffector(0),
                at_s,
                position_m: [None, None, Some(0.07)],
                velocity_m_s: [None; 3],
                heading_rad: None,
            });
            let raised = problem(&motion);
            // Lagrange's parabola through samples 7, 8 and 9 at 8.4; rounding only.
            let parabola = -0.12 * raised[8][0] + 0.84 * raised[9][0] + 0.28 * raised[10][0];
            assert!((parabola - 0.07).abs() < 1e-15, "{parabola}");
            for (t, (raised, plain)) in raised.iter().zip(&plain).enumerate() {
                let other = (4..=6).contains(&t);
                let factor = raised[0] / plain[0];
                assert!(plain[0] == 0.0 || (factor == 1.0) == other, "{t}: {factor}");
                assert_eq!(raised[1..], plain[1..]);
            }
            if ends == Ends::Periodic {
                assert_eq!((&raised[0], &raised[11]), (&raised[10], &raised[1]));
            }
        }
    }
}
