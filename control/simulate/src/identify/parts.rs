//! Fits of separate parts of a run, whose disagreement beyond noise shows errors of the model.
//!
//! The Hessian predicts the effect of noise on a parameter. A contact or a drive of another kind than the modelled one also
//! changes the parameter, in one direction while a wheel slips and in another while it rolls. More measurements do not remove
//! this error. Each part is therefore fitted from its measured start. The variance of the results beyond their own variances is
//! the variance of the model error ([`effects`]). This variance counts in full, because model errors do not cancel as noise
//! does. An error that is equal in all parts stays unknown.

use super::effects::{self, SourceEstimate};
use super::quantity::SimulationModel;
use super::recording::Recording;
use super::rollout::Replay;
use super::start::Start;
use std::sync::Arc;

/// Duration of the shortest part, s. In a shorter part the free start state would use up most of the measurements.
const PART_S: f64 = 0.8;
/// Minimum number of parts for an estimate of the variance.
const FEWEST: usize = 3;
/// Maximum number of parts. Longer parts determine their parameters better.
const MOST: usize = 6;

/// Divides the first steps of a run into parts; empty if the steps are too few.
pub(super) fn of(replay: &Replay, file: &SimulationModel, steps: usize) -> Vec<Replay> {
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

/// Standard deviation of the differences between parts that noise does not explain; 0 if fewer than [`FEWEST`] parts are known.
pub(super) fn spread(parts: &[SourceEstimate]) -> f64 {
    let known = parts.iter().filter(|part| part.is_known()).count();
    if known < FEWEST { 0.0 } else { effects::between(parts) }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn reports(values: [f64; 4], deviation: f64) -> Vec<SourceEstimate> {
        values.map(|value| SourceEstimate { value, deviation }).to_vec()
    }

    #[test]
    fn parts_that_differ_by_their_noise_agree() {
        // The variance of the values is 0.01².
        let by = 0.01 * 0.75_f64.sqrt();
        assert!(spread(&reports([1.0 + by, 1.0 - by, 1.0 + by, 1.0 - by], 0.01001)).abs() < 1e-9);
        assert_eq!(spread(&reports([1.0; 4], 0.01)), 0.0);
        assert_eq!(spread(&reports([1.0, 9.0, 1.0, 9.0], f64::INFINITY)), 0.0);
        assert_eq!(spread(&reports([1.0, 9.0, 1.0, 9.0], 0.01)[..2]), 0.0);
    }

    #[test]
    fn what_they_disagree_about_is_the_model() {
        // Variance 0.05² between the sources and 0.03² of noise, as the variance of four values: Σ (v − m)² = 3 (0.05² +
        // 0.03²).
        let by = (0.75 * (0.05_f64.powi(2) + 0.03_f64.powi(2))).sqrt();
        let found = spread(&reports([2.0 + by, 2.0 - by, 2.0 + by, 2.0 - by], 0.03));
        assert!((found - 0.05).abs() < 1e-12, "{found}");
        // A very uncertain source does not count.
        let mut all = reports([2.0 + by, 2.0 - by, 2.0 + by, 2.0 - by], 0.03);
        all.push(SourceEstimate { value: 9.0, deviation: 1e4 });
        assert!((spread(&all) - found).abs() < 0.01, "{}", spread(&all));
    }
}
