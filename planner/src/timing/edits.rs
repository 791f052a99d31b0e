//! Edits of footfalls by one sample: all swings alike, or the feet that switch at one time.

use crate::motion::{Ends, Motion};
use crate::sensitivity::TimingPrices;

/// Number of samples of a swing that is not shortened. Shorter swings cost less but slip more.
const SWING_SAMPLES: usize = 5;

/// Changed footfalls.
#[derive(Clone, Debug, PartialEq)]
pub struct Edit {
    pub stance: Vec<Vec<bool>>,
    /// Change of the costs to first order.
    pub predicted: f64,
}

/// Lift-off and touch-down times, with the change of the costs if each occurs one sample later.
struct Switches {
    /// Index of the sample before each switch.
    at: Vec<usize>,
    /// Change of the costs, to first order, if the switch is one sample later.
    later: Vec<f64>,
}

impl Switches {
    fn of(motion: &Motion, prices: &TimingPrices) -> Self {
        let (stance, intervals) = (&motion.stance, prices.interval_per_s.len());
        let is_switch = |&i: &usize| stance[i] != stance[(i + 1) % stance.len()];
        let at: Vec<usize> = (0..intervals).filter(is_switch).collect();
        let mut switches = Self { later: vec![0.0; at.len()], at };
        let (count, h) = (switches.at.len(), motion.interval_s());
        for k in 0..count {
            // Spans of an end at rest reach to this end.
            let before = (k > 0 || motion.ends == Ends::Periodic)
                .then(|| switches.at[(k + count - 1) % count]);
            let after = (k + 1 < count || motion.ends == Ends::Periodic)
                .then(|| switches.at[(k + 1) % count]);
            let [before, after] = [
                mean(prices, before.map_or(0, |from| from + 1), switches.at[k]),
                mean(prices, switches.at[k] + 1, after.unwrap_or(intervals)),
            ];
            switches.later[k] = h * (before - after);
        }
        switches
    }
}

/// Mean price of the intervals from `from` up to `to`, which may be beyond the end of a period. If `from` equals `to`, the price
/// of this interval.
fn mean(prices: &TimingPrices, from: usize, to: usize) -> f64 {
    let intervals = prices.interval_per_s.len();
    let length = (to + intervals - from % intervals) % intervals;
    let length = length.max(1);
    let sum: f64 = (0..length).map(|k| prices.interval_per_s[(from + k) % intervals]).sum();
    sum / length as f64
}

/// Change of all swings by one sample, at their lift-off or touch-down.
#[derive(Clone, Copy)]
enum SwingChange {
    LiftEarlier,
    LiftLater,
    LandEarlier,
    LandLater,
}

impl SwingChange {
    const ALL: [Self; 4] = [Self::LiftEarlier, Self::LandLater, Self::LiftLater, Self::LandEarlier];

    /// Contact flag of a foot, from its flags before, at and after the sample.
    fn flag(self, [before, here, after]: [bool; 3]) -> bool {
        match self {
            Self::LiftEarlier => here && after,
            Self::LandLater => here && before,
            Self::LiftLater => here || before,
            Self::LandEarlier => here || after,
        }
    }

    /// Number of samples by which a switch of the given kind moves later.
    fn moves(self, lifts: bool) -> f64 {
        match (self, lifts) {
            (Self::LiftEarlier, true) | (Self::LandEarlier, false) => -1.0,
            (Self::LiftLater, true) | (Self::LandLater, false) => 1.0,
            _ => 0.0,
        }
    }
}

/// Returns the edits of a motion's footfalls that the bounds of the request permit, in ascending order of the predicted costs.
pub fn edits(given: &Motion, motion: &Motion, prices: &TimingPrices) -> Vec<Edit> {
    let switches = Switches::of(motion, prices);
    let mut edits: Vec<Edit> = swing_edits(motion)
        .map(|(change, stance)| {
            let predicted = switches.at.iter().zip(&switches.later).map(|(&i, later)| {
                let moved = mean_move(motion, i, change);
                moved * later
            });
            Edit { stance, predicted: predicted.sum() }
        })
        .collect();
    for (&i, &later) in switches.at.iter().zip(&switches.later) {
        let next = (i + 1) % motion.stance.len();
        // One sample later, the next sample has the flags of this one.
        for (to, from, predicted) in [(next, i, later), (i, next, -later)] {
            let mut stance = motion.stance.clone();
            stance[to] = motion.stance[from].clone();
            edits.push(Edit { stance, predicted });
        }
    }
    edits.retain(|edit| is_allowed(given, &edit.stance));
    edits.sort_by(|a, b| a.predicted.total_cmp(&b.predicted));
    edits
}

/// Returns the footfalls with longer swings that the bounds of the request permit. Each adds a sample to the one before,
/// alternately at lift-off and touch-down.
pub fn longer_swings(given: &Motion) -> Vec<Vec<Vec<bool>>> {
    let mut longer = Vec::new();
    let mut stance = given.stance.clone();
    for change in [SwingChange::LiftEarlier, SwingChange::LandLater].into_iter().cycle() {
        let next = changed(&given.with_stance(stance.clone()), change);
        // Footfalls without swings have none that could become longer.
        if next == stance || !is_allowed(given, &next) {
            return longer;
        }
        stance = next;
        longer.push(stance.clone());
    }
    longer
}

/// Mean number of samples by which a change delays the switch after sample `i`, over the feet that switch there.
fn mean_move(motion: &Motion, i: usize, change: SwingChange) -> f64 {
    let (here, next) = (&motion.stance[i], &motion.stance[(i + 1) % motion.stance.len()]);
    let moves: Vec<f64> = here
        .iter()
        .zip(next)
        .filter(|(here, next)| here != next)
        .map(|(here, _)| change.moves(*here))
        .collect();
    moves.iter().sum::<f64>() / moves.len().max(1) as f64
}

fn swing_edits(motion: &Motion) -> impl Iterator<Item = (SwingChange, Vec<Vec<bool>>)> + '_ {
    SwingChange::ALL.into_iter().map(|change| (change, changed(motion, change)))
}

fn changed(motion: &Motion, change: SwingChange) -> Vec<Vec<bool>> {
    let stance = &motion.stance;
    let count = stance.len();
    // Beyond its ends, a motion that does not repeat continues with the flags there.
    let at = |i: usize, step: usize| match motion.ends {
        Ends::Periodic => (i + count + step - 1) % count,
        Ends::AtRest | Ends::Prescribed => (i + step).clamp(1, count) - 1,
    };
    let flags = |i: usize| {
        let around = |j: usize| [0, 1, 2].map(|step| stance[at(i, step)][j]);
        (0..stance[i].len()).map(|j| change.flag(around(j))).collect()
    };
    (0..count).map(flags).collect()
}

/// Returns true if stances and swings have lengths within the bounds of the request, and if the smallest number of feet on the
/// ground is at least that of the request.
fn is_allowed(given: &Motion, stance: &[Vec<bool>]) -> bool {
    let periodic = given.ends == Ends::Periodic;
    let rests = [stance.first(), stance.last()].into_iter().flatten().flatten().all(|down| *down);
    let least_down = |stance: &[Vec<bool>]| {
        stance.iter().map(|feet| feet.iter().filter(|down| **down).count()).min()
    };
    let feet = 0..given.stance[0].len();
    (periodic || rests)
        && least_down(stance) >= least_down(&given.stance)
        && feet.into_iter().all(|j| {
            let [before, after] = [&given.stance[..], stance].map(|flags| runs(flags, j, periodic));
            [true, false].into_iter().all(|down| {
                let lengths = |runs: &[(bool, usize)]| -> Vec<usize> {
                    runs.iter().filter(|run| run.0 == down).map(|run| run.1).collect()
                };
                let (before, after) = (lengths(&before), lengths(&after));
                let (Some(&least), Some(&most)) = (before.iter().min(), before.iter().max()) else {
                    return after.is_empty();
                };
                let shortest = *given.timing.range(least).start();
                let shortest = if down { shortest } else { shortest.max(SWING_SAMPLES.min(least)) };
                let allowed = shortest..=*given.timing.range(most).end();
                // Spans of ends at rest may be short: a foot stands before the motion.
                let allowed = if down && !periodic { 1..=usize::MAX } else { allowed };
                before.len() == after.len() && after.iter().all(|length| allowed.contains(length))
            })
        })
}

/// Lengths of the stances and swings of a foot, in samples. A swing or stance across the end of a period counts as one.
fn runs(stance: &[Vec<bool>], j: usize, periodic: bool) -> Vec<(bool, usize)> {
    let mut runs: Vec<(bool, usize)> = Vec::new();
    for flags in stance {
        match runs.last_mut() {
            Some((down, length)) if *down == flags[j] => *length += 1,
            _ => runs.push((flags[j], 1)),
        }
    }
    if periodic && runs.len() > 1 && runs[0].0 == runs[runs.len() - 1].0 {
        let last = runs.pop().map_or(0, |run| run.1);
        runs[0].1 += last;
    }
    runs
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::motion::{FreeTimes, Timing};
    use crate::planning::{Options, optimise_solution};
    use crate::sensitivity::Optimal;
    use crate::solve::Progress;
    use crate::test_robots;
    use std::ops::ControlFlow;

    #[test]
    fn a_motion_without_swings_has_no_longer_ones() {
        let robot = &test_robots::all()[0];
        let mut motion = test_robots::motion(robot, Ends::AtRest);
        motion.stance.iter_mut().for_each(|flags| flags.fill(true));
        assert!(longer_swings(&motion).is_empty());
    }

    /// Motion in which one foot has the given flags, and the others stand.
    fn stepping(flags: &str, ends: Ends) -> Motion {
        let robot = &test_robots::all()[0];
        let mut motion = test_robots::motion(robot, ends);
        let feet = robot.end_effectors.len();
        motion.stance =
            flags.chars().map(|c| (0..feet).map(|j| j > 0 || c == '#').collect()).collect();
        motion.timing = Timing { free: FreeTimes::Free, ..Timing::default() };
        motion
    }

    fn flags(stance: &[Vec<bool>]) -> String {
        stance.iter().map(|feet| if feet[0] { '#' } else { '.' }).collect()
    }

    fn prices(per_s: &[f64]) -> TimingPrices {
        let mean = per_s.iter().sum::<f64>() / per_s.len() as f64;
        TimingPrices { cost: 1.0, duration_per_s: mean, interval_per_s: per_s.to_vec() }
    }

    #[test]
    fn a_switch_moves_from_the_dear_span_to_the_cheap_one() {
        let motion = stepping("####......######", Ends::Periodic);
        // Time in swing saves costs, time in stance raises them.
        let per_s: Vec<f64> =
            motion.stance.iter().map(|feet| if feet[0] { 1.0 } else { -1.0 }).collect();
        let edits = edits(&motion, &motion, &prices(&per_s));
        let best = &edits[0];
        assert!(best.predicted < 0.0);
        let swing = |stance: &[Vec<bool>]| flags(stance).matches('.').count();
        for edit in &edits {
            let by = swing(&edit.stance) as isize - 6;
            assert_eq!(by > 0, edit.predicted < 0.0, "{} {}", flags(&edit.stance), edit.predicted);
        }
        // One foot: a change of all swings is that of this foot.
        let all: Vec<String> = edits.iter().map(|edit| flags(&edit.stance)).collect();
        for expected in
            ["###.......######", "####.......#####", "#####.....######", "####.....#######"]
        {
            assert_eq!(all.iter().filter(|flags| *flags == expected).count(), 2, "{all:?}");
        }
    }

    #[test]
    fn prices_of_switches_are_those_of_plans_with_moved_switches() {
        let robot = test_robots::all().swap_remove(0);
        let text = include_str!("../../../shipped/motions/trot.toml");
        let trot = Motion::from_toml("trot.toml", text, &robot).expect("a shipped motion");
        let options = Options { refine: false, ..Options::default() };
        let optimum = |motion: &Motion| {
            let on = &mut |_: &Progress| ControlFlow::Continue(());
            let solution = optimise_solution(&robot, motion, &options, on);
            Optimal::of(&solution, &options, on).expect("an optimum").timing_prices()
        };
        let here = optimum(&trot);
        let switches = Switches::of(&trot, &here);
        // Diagonal feet lift off, land, and the others do so.
        assert_eq!(switches.at, [1, 10, 13, 22]);
        for (&i, predicted) in switches.at.iter().zip(&switches.later).take(2) {
            let moved = |to: usize, from: usize| {
                let mut stance = trot.stance.clone();
                stance[to] = trot.stance[from].clone();
                optimum(&trot.with_stance(stance)).cost
            };
            let [later, earlier] = [moved(i + 1, i), moved(i, i + 1)];
            // A whole sample is a large step: costs are curved by a fifth of the change.
            let difference = 0.5 * (later - earlier);
            assert!((predicted / difference - 1.0).abs() < 0.3, "{i}: {predicted} {difference}");
        }
    }

    #[test]
    fn bounds_and_five_samples_limit_swings() {
        let swings = |count: usize, ends| {
            let motion = stepping(&format!("####{}####", ".".repeat(count)), ends);
            let lengths = edits(
                &motion,
                &motion,
                &prices(&vec![0.0; 8 + count - usize::from(ends == Ends::AtRest)]),
            )
            .into_iter()
            .map(|edit| flags(&edit.stance).matches('.').count());
            let mut lengths: Vec<usize> = lengths.collect();
            lengths.sort_unstable();
            lengths.dedup();
            lengths
        };
        for ends in [Ends::Periodic, Ends::AtRest] {
            assert_eq!(swings(5, ends), [6]);
            assert_eq!(swings(6, ends), [5, 7]);
            // A swing that is shorter already is not shortened further.
            assert_eq!(swings(4, ends), [5]);
        }
    }

    #[test]
    fn longer_swings_grow_at_both_ends_within_the_bounds() {
        let motion = stepping("#####.....##########", Ends::AtRest);
        let longer: Vec<String> = longer_swings(&motion).iter().map(|s| flags(s)).collect();
        assert_eq!(longer, ["####......##########", "####.......#########"]);
    }

    #[test]
    fn ends_at_rest_keep_all_feet_down() {
        let motion = stepping("#.....##########", Ends::AtRest);
        assert!(edits(&motion, &motion, &prices(&[0.0; 15])).iter().all(|edit| edit.stance[0][0]));
    }
}
