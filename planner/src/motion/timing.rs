//! Timing of a motion: which of its times the planner may change, and by how much.

use rollwalk_robot::document::Table;
use serde::{Deserialize, Serialize};

/// Key of the free times in motion files.
const KEY: &str = "timing";
/// Key of the bounds in motion files.
const BOUNDS: &str = "timing_bounds";
/// Default bounds. Beyond these bounds, plans with lower costs slipped more when played.
const USUAL_BOUNDS: [f64; 2] = [0.7, 1.4];
/// Smallest lower and largest upper bound.
const WIDEST_BOUNDS: [f64; 2] = [0.25, 4.0];

/// Times of a motion that the planner may change.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum FreeTimes {
    /// Duration and footfalls of the file.
    #[default]
    Given,
    /// Duration of the whole motion. Stances and swings keep their shares of it.
    Duration,
    /// Duration of the whole motion, and times of lift-off and touch-down of each foot.
    Free,
}

/// Times that the planner may change, and their bounds.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Timing {
    /// Times that may change.
    pub free: FreeTimes,
    /// Bounds of durations, as multiples of those of the file: of the motion, and of each stance and swing.
    pub bounds: [f64; 2],
}

impl Default for Timing {
    fn default() -> Self {
        Self { free: FreeTimes::Given, bounds: USUAL_BOUNDS }
    }
}

impl Timing {
    /// Returns true if no time may change.
    pub fn is_given(&self) -> bool {
        self.free == FreeTimes::Given
    }

    /// Reads the keys of a motion file. Targets and height limits at given times need the given timing.
    pub(super) fn read(root: &Table<'_>, timed: &[(&'static str, bool)]) -> Option<Self> {
        let choices = [FreeTimes::Given, FreeTimes::Duration, FreeTimes::Free];
        let free = match root.has(KEY) {
            true => root.choice(KEY, &["given", "duration", "free"]).map(|index| choices[index]),
            false => Some(FreeTimes::Given),
        };
        let bounds = match root.has(BOUNDS) {
            true => bounds(root),
            false => Some(USUAL_BOUNDS),
        };
        let (free, bounds) = (free?, bounds?);
        if free == FreeTimes::Given && root.has(BOUNDS) {
            let help = "give `timing = \"duration\"` or `timing = \"free\"`, or leave out \
                        `timing_bounds`";
            root.fault(BOUNDS, "bounds times that are given", "nothing to bound", help);
            return None;
        }
        if let Some((key, _)) =
            timed.iter().find(|(_, is_timed)| *is_timed && free != FreeTimes::Given)
        {
            let help = format!(
                "leave out `timing`, because `[[{key}]]` names times in seconds, or leave out \
                 `[[{key}]]`"
            );
            root.fault(
                KEY,
                format_args!("is given together with `[[{key}]]`"),
                "times are fixed",
                help,
            );
            return None;
        }
        Some(Self { free, bounds })
    }

    /// Range of a number of samples or frames, as multiples of the given number within the bounds.
    pub fn range(&self, given: usize) -> std::ops::RangeInclusive<usize> {
        let [least, most] = self.bounds.map(|bound| bound * given as f64);
        // A bound that rounding moves past a whole number still includes this number.
        ((least - 1e-9).ceil() as usize).max(1)..=(most + 1e-9).floor() as usize
    }
}

fn bounds(root: &Table<'_>) -> Option<[f64; 2]> {
    let given = root.numbers::<2>(BOUNDS)?;
    let ([least, most], [lowest, highest]) = (given, WIDEST_BOUNDS);
    if lowest <= least && least <= 1.0 && 1.0 <= most && most <= highest {
        return Some(given);
    }
    let help = format!(
        "give [least, most] as multiples of the given times, with least from {lowest} to 1 and \
         most from 1 to {highest}, such as [0.7, 1.4]"
    );
    root.fault(BOUNDS, format_args!("is [{least}, {most}]"), "out of range", help);
    None
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ranges_include_bounds_that_rounding_moves() {
        let timing = Timing::default();
        // 0.7 · 10 is 7 and 1.4 · 5 is 7, but not in binary.
        assert_eq!(timing.range(10), 7..=14);
        assert_eq!(timing.range(5), 4..=7);
        assert_eq!(Timing { bounds: [0.25, 4.0], ..timing }.range(1), 1..=4);
    }
}
