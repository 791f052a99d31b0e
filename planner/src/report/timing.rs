//! Comparison of the chosen times of a plan with those of its request.

use crate::motion::Ends;
use crate::plan::{Plan, TimingChoice, TimingScore};
use serde::Serialize;
use std::fmt;

/// Difference between chosen and given times below which the report omits it, s: a tenth of a library frame.
const SAME_S: f64 = 1.0 / 600.0;

/// Times of a request and of its plan.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct TimingChange {
    /// Duration of the request and of the plan, s.
    pub duration_s: [f64; 2],
    /// Mean duration of the swings of the request and of the plan, s; `None` if nothing swings.
    pub swing_s: Option<[f64; 2]>,
    /// Plan with the times of the request; `None` if none converged.
    pub given: Option<TimingScore>,
    /// Plan with the chosen times.
    pub chosen: TimingScore,
    /// Number of timings for which a plan was sought.
    pub tried: usize,
}

impl TimingChange {
    /// Compares the times of a plan with those of its request. `None` for a plan with given times.
    pub(super) fn of(plan: &Plan) -> Option<Self> {
        let TimingChoice { given_duration_s, given_stance, given, chosen, tried } =
            plan.solve.timing.as_ref()?;
        let ends = plan.motion.ends;
        let swings = [
            mean_swing_s(given_stance, ends, *given_duration_s),
            mean_swing_s(&plan.motion.stance, ends, plan.motion.duration_s),
        ];
        Some(Self {
            duration_s: [*given_duration_s, plan.motion.duration_s],
            swing_s: swings[0].zip(swings[1]).map(|(given, chosen)| [given, chosen]),
            given: *given,
            chosen: *chosen,
            tried: *tried,
        })
    }
}

/// Mean time from lift-off to landing, s: from the last sample in stance to the next one, also across the end of a period. More
/// samples at the same times do not change it.
fn mean_swing_s(stance: &[Vec<bool>], ends: Ends, duration_s: f64) -> Option<f64> {
    let (samples, feet) = (stance.len(), stance.first()?.len());
    let intervals = if ends == Ends::Periodic { samples } else { samples - 1 };
    let flags = |i: usize, j: usize| stance[i % samples][j];
    let pairs = || (0..intervals).flat_map(|i| (0..feet).map(move |j| (i, j)));
    let lifts = pairs().filter(|&(i, j)| flags(i, j) && !flags(i + 1, j)).count();
    let in_the_air = pairs().filter(|&(i, j)| !flags(i, j) || !flags(i + 1, j)).count();
    (lifts > 0).then(|| in_the_air as f64 / lifts as f64 * duration_s / intervals as f64)
}

impl fmt::Display for TimingChange {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { duration_s: [given_s, chosen_s], swing_s, given, chosen, tried } = self;
        let differs = |[a, b]: [f64; 2]| (a - b).abs() > SAME_S;
        if given.as_ref() == Some(chosen) {
            return write!(f, "timing, chosen from {tried}: as given");
        }
        write!(f, "timing, chosen from {tried}: duration {chosen_s:.3} s")?;
        if differs(self.duration_s) {
            write!(f, " instead of {given_s:.3} s")?;
        } else {
            f.write_str(" as given")?;
        }
        if let Some([given_s, chosen_s]) = swing_s.filter(|swings| differs(*swings)) {
            write!(f, ", mean swing {chosen_s:.3} s instead of {given_s:.3} s")?;
        }
        let TimingScore { cost, as_played } = chosen;
        match given {
            Some(given) => write!(
                f,
                "; with the samples of the file, costs {cost:.4} instead of {:.4}, largest residual as \
                 played {as_played:.2} of its tolerance instead of {:.2}",
                given.cost, given.as_played
            ),
            None => write!(
                f,
                "; no plan was found with the given times; largest residual as played \
                 {as_played:.2} of its tolerance"
            ),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_swing_across_the_end_of_a_period_is_one() {
        let flags = |text: &str| text.chars().map(|c| vec![c == '#']).collect::<Vec<_>>();
        // Three of six intervals of 0.1 s, and the same times with twice the samples.
        for stance in [".####.", "...#######.."] {
            let mean = mean_swing_s(&flags(stance), Ends::Periodic, 0.6).expect("a swing");
            assert!((mean - 0.3).abs() < 1e-12, "{stance}: {mean}");
        }
        for stance in ["#..###", "#.....#####"] {
            let mean = mean_swing_s(&flags(stance), Ends::AtRest, 0.5).expect("a swing");
            assert!((mean - 0.3).abs() < 1e-12, "{stance}: {mean}");
        }
        assert_eq!(mean_swing_s(&flags("##"), Ends::Periodic, 1.0), None);
    }

    #[test]
    fn the_text_names_what_changed() {
        let score = |cost, as_played| TimingScore { cost, as_played };
        let change = |swing_s, given| TimingChange {
            duration_s: [0.8, 0.9833],
            swing_s,
            given,
            chosen: score(0.31, 0.42),
            tried: 7,
        };
        let text = change(Some([0.2, 0.2]), Some(score(0.353, 0.31))).to_string();
        assert_eq!(
            text,
            "timing, chosen from 7: duration 0.983 s instead of 0.800 s; with the samples of the file, costs 0.3100 instead of \
             0.3530, largest residual as played 0.42 of its tolerance instead of 0.31"
        );
        let text = change(None, Some(score(0.31, 0.42))).to_string();
        assert_eq!(text, "timing, chosen from 7: as given");
        let text = change(Some([0.2, 0.25]), None).to_string();
        assert!(text.contains("mean swing 0.250 s instead of 0.200 s"), "{text}");
        assert!(text.contains("no plan was found with the given times"), "{text}");
    }
}
