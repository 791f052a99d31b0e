//! Parts of a run, each fitted alone: where they disagree by more than noise, the model is wrong.
//!
//! The Hessian knows how noise moves a parameter. A contact or a drive of another kind moves it, too, one way while a wheel slips and
//! another way while it rolls, and more measurements do not take that off. So each part is fitted from where it was measured to begin,
//! and the variance of what they tell beyond their own is that of the model (DerSimonian and Laird 1986, random effects). It counts in full: errors of
//! a model do not cancel as noise does. An error that is the same in all parts stays unknown.

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

/// A parameter as one part has it, and how well by its noise.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Told {
    pub value: f64,
    pub deviation: f64,
}

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

/// Deviation between parts beyond what noise makes of them.
pub(super) fn spread(told: &[Told]) -> f64 {
    let known: Vec<(f64, f64)> = told
        .iter()
        .filter(|told| told.deviation.is_finite() && told.deviation > 0.0)
        .map(|told| (told.value, told.deviation.powi(-2)))
        .collect();
    if known.len() < FEWEST {
        return 0.0;
    }
    let sum = |of: fn(&(f64, f64)) -> f64| known.iter().map(of).sum::<f64>();
    let weights = sum(|(_, weight)| *weight);
    let mean = sum(|(value, weight)| value * weight) / weights;
    let off: f64 = known.iter().map(|(value, weight)| weight * (value - mean).powi(2)).sum();
    let own = weights - sum(|(_, weight)| weight * weight) / weights;
    ((off - (known.len() - 1) as f64) / own).max(0.0).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn told(values: [f64; 4], deviation: f64) -> Vec<Told> {
        values.map(|value| Told { value, deviation }).to_vec()
    }

    #[test]
    fn parts_that_differ_by_their_noise_agree() {
        // Their variance is 0.01².
        let by = 0.01 * 0.75_f64.sqrt();
        assert!(spread(&told([1.0 + by, 1.0 - by, 1.0 + by, 1.0 - by], 0.01001)).abs() < 1e-9);
        assert_eq!(spread(&told([1.0; 4], 0.01)), 0.0);
        assert_eq!(spread(&told([1.0, 9.0, 1.0, 9.0], f64::INFINITY)), 0.0);
        assert_eq!(spread(&told([1.0, 9.0, 1.0, 9.0], 0.01)[..2]), 0.0);
    }

    #[test]
    fn what_they_disagree_about_is_the_model() {
        // 0.05² between them and 0.03² of noise, as the variance of four: Σ (v − m)² = 3 (0.05² + 0.03²).
        let by = (0.75 * (0.05_f64.powi(2) + 0.03_f64.powi(2))).sqrt();
        let found = spread(&told([2.0 + by, 2.0 - by, 2.0 + by, 2.0 - by], 0.03));
        assert!((found - 0.05).abs() < 1e-12, "{found}");
        // One that knows next to nothing does not count.
        let mut all = told([2.0 + by, 2.0 - by, 2.0 + by, 2.0 - by], 0.03);
        all.push(Told { value: 9.0, deviation: 1e4 });
        assert!((spread(&all) - found).abs() < 0.01, "{}", spread(&all));
    }
}
