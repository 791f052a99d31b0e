//! Smoothing of samples by a Gaussian.

/// Distance beyond which the Gaussian is cut off, in standard deviations.
pub const CUT_OFF: f64 = 4.0;

/// Convolves samples with a Gaussian. The deviation is in samples. The first and the last sample continue beyond the ends.
pub fn blurred(samples: &[f64], deviation: f64) -> Vec<f64> {
    let reach = (CUT_OFF * deviation).ceil() as isize;
    let weights: Vec<f64> =
        (-reach..=reach).map(|k| (-0.5 * (k as f64 / deviation).powi(2)).exp()).collect();
    let total: f64 = weights.iter().sum();
    let last = samples.len() as isize - 1;
    let at = |i: isize| {
        let near = (-reach..=reach).zip(&weights);
        near.map(|(k, weight)| weight * samples[(i + k).clamp(0, last) as usize]).sum::<f64>()
    };
    (0..=last).map(|i| at(i) / total).collect()
}
