//! Heights of end effectors in swing: a smooth profile from lift-off to touch-down (Eq. 2.9).
//!
//! The thesis asks for a constant height in swing. A profile w_h·sin²(πu), u running from the last
//! stance sample before the swing to the first after it, transfers better to real servos: it leaves
//! and meets the ground without a vertical speed.

use crate::variables::TimelineSample;
use std::f64::consts::PI;

/// Contact heights along the timeline, `[timeline sample][end effector]`, m. `slot_stance` holds the
/// contact flags of the slots; a swing of a periodic motion may run across its seam.
pub fn heights(
    timeline: &[TimelineSample],
    slot_stance: &[Vec<bool>],
    periodic: bool,
    swing_height_m: f64,
) -> Vec<Vec<f64>> {
    let stance: Vec<&Vec<bool>> = timeline.iter().map(|s| &slot_stance[s.slot]).collect();
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
                            let u = since as f64 / (since + until) as f64;
                            swing_height_m * (PI * u).sin().powi(2)
                        }
                        // Never down on one side: hold the height.
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
    use crate::variables::Lift;

    fn timeline(slots: &[usize]) -> Vec<TimelineSample> {
        slots.iter().map(|&slot| TimelineSample { slot, lift: Lift::Identity }).collect()
    }

    #[test]
    fn a_swing_across_the_seam_is_one_arch() {
        let stance: Vec<Vec<bool>> = [false, true, true, false].map(|c| vec![c]).to_vec();
        let heights = heights(&timeline(&[3, 0, 1, 2, 3, 0]), &stance, true, 0.03);
        let column: Vec<f64> = heights.iter().map(|h| h[0]).collect();
        let expected = 0.03 * (PI / 3.0).sin().powi(2);
        for (height, expected) in
            column.iter().zip([expected, expected, 0.0, 0.0, expected, expected])
        {
            assert!((height - expected).abs() < 1e-15, "{column:?}");
        }
    }

    /// Heights of one end effector along a motion whose ends stand for the samples beyond them.
    fn at_rest(stance: [bool; 5]) -> Vec<f64> {
        let stance: Vec<Vec<bool>> = stance.map(|down| vec![down]).to_vec();
        let heights = heights(&timeline(&[0, 0, 1, 2, 3, 4, 4]), &stance, false, 0.03);
        heights.iter().map(|h| h[0]).collect()
    }

    #[test]
    fn a_swing_between_ends_at_rest_rises_to_the_swing_height_in_its_middle() {
        let heights = at_rest([true, false, false, false, true]);
        // sin²(π/4) is a half; rounding only.
        for (height, expected) in heights.iter().zip([0.0, 0.0, 0.5, 1.0, 0.5, 0.0, 0.0]) {
            assert!((height - 0.03 * expected).abs() < 1e-15, "{heights:?}");
        }
    }

    #[test]
    fn a_swing_that_reaches_an_end_holds_its_height_there() {
        // At rest no foot comes down beyond the end, and none wraps round to the start.
        let heights = at_rest([true, true, false, false, false]);
        assert_eq!(heights, [0.0, 0.0, 0.0, 0.03, 0.03, 0.03, 0.03]);
        assert_eq!(at_rest([false; 5]), [0.03; 7]);
    }
}
