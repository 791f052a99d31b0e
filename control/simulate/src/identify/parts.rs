//! Parts of a run, each fitted alone: where they disagree by more than noise, the model is wrong.
//!
//! The Hessian knows how noise moves a parameter. A contact or a drive of another kind moves it, too, one way while a wheel
//! slips and another way while it rolls, and more measurements do not take that off. So each part is fitted from where it was
//! measured to begin, and the variance of what they tell beyond their own is that of the model ([`effects`]). It counts in
//! full: errors of a model do not cancel as noise does. An error that is the same in all parts stays unknown.

use super::effects::{self, Report};
use super::quantity::Model;
use super::recording::Recording;
use super::rollout::Replay;
use super::start::Start;
use std::sync::Arc;

/// Shortest part, s: in less the beginning, which is free in each, takes most of what was measured.
const PART_S: f64 = 0.8;
/// Fewest parts of which a variance says something, and most: longer parts know more.
const FEWEST: usize = 3;
const MOST: usize = 6;

/// The first steps of a run in parts; none if they are too few.
pub(super) fn of(replay: &Replay, file: &Model, steps: usize) -> Vec<Replay> {
    let count = ((steps as f64 * replay.step_s / PART_S) as usize).min(MOST);
    if count < FEWEST {
        return Vec::new();
    }
    let steps = steps / count;
    let begin_s = replay.recording.span_s[0];
    let at_s = |part: usize| begin_s + (part * steps) as f64 * replay.step_s;
    let of = |part: usize| {
        let span_s = [at_s(part), at_s(part + 1)];
        let recording = Recording { span_s, ..(*replay.recording).clone() };
        let start = Start::of(&recording, file);
        Replay { recording: Arc::new(recording), start, steps, ..replay.clone() }
    };
    (0..count).map(of).collect()
}

/// Deviation between parts beyond what noise makes of them; 0 of parts too few to know it.
pub(super) fn spread(parts: &[Report]) -> f64 {
    let known = parts.iter().filter(|part| part.is_known()).count();
    if known < FEWEST { 0.0 } else { effects::between(parts) }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn reports(values: [f64; 4], deviation: f64) -> Vec<Report> {
        values.map(|value| Report { value, deviation }).to_vec()
    }

    #[test]
    fn parts_that_differ_by_their_noise_agree() {
        // Their variance is 0.01².
        let by = 0.01 * 0.75_f64.sqrt();
        assert!(spread(&reports([1.0 + by, 1.0 - by, 1.0 + by, 1.0 - by], 0.01001)).abs() < 1e-9);
        assert_eq!(spread(&reports([1.0; 4], 0.01)), 0.0);
        assert_eq!(spread(&reports([1.0, 9.0, 1.0, 9.0], f64::INFINITY)), 0.0);
        assert_eq!(spread(&reports([1.0, 9.0, 1.0, 9.0], 0.01)[..2]), 0.0);
    }

    #[test]
    fn what_they_disagree_about_is_the_model() {
        // 0.05² between them and 0.03² of noise, as the variance of four: Σ (v − m)² = 3 (0.05² + 0.03²).
        let by = (0.75 * (0.05_f64.powi(2) + 0.03_f64.powi(2))).sqrt();
        let found = spread(&reports([2.0 + by, 2.0 - by, 2.0 + by, 2.0 - by], 0.03));
        assert!((found - 0.05).abs() < 1e-12, "{found}");
        // One that knows next to nothing does not count.
        let mut all = reports([2.0 + by, 2.0 - by, 2.0 + by, 2.0 - by], 0.03);
        all.push(Report { value: 9.0, deviation: 1e4 });
        assert!((spread(&all) - found).abs() < 0.01, "{}", spread(&all));
    }
}
