//! Means around a sample, to which the dynamics apply.
//!
//! The mean around a sample weights each time by 1 − |t|/h, where t is relative to the sample. The mean of a second derivative
//! is the second difference (x₋ − 2x + x₊)/h², for every curve through the samples. Forces are linear between samples, and
//! their mean is (f₋ + 4f + f₊)/6. The rows of the dynamics in these means therefore apply to the splines that the controller
//! plays.
//!
//! If the rows used the force f of the sample alone, those splines would need forces that the plan does not contain: 4 % of the
//! weight in a walk and 46 % in a pronk, root mean square. With the means, 0.04 % and 1 % remain. A finer grid alone did not
//! help.
//!
//! At the ends of a motion that is not periodic, the mean covers the one interval inside. There, x₋ = x − h ẋ, because the
//! state outside extrapolates the velocity at the end.

/// Weights of a sample and its neighbours in the mean around it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MeanWeights {
    /// Weights of previous, present and next sample in the mean of a function that is linear between samples.
    pub linear: [f64; 3],
    /// Ratio of the mean of a second derivative to the second difference.
    pub second_difference: f64,
}

impl MeanWeights {
    /// Computes the weights around a sample with an interval of the motion before it, after it, or both.
    pub fn new(before: bool, after: bool) -> Self {
        let [before, after] = [before, after].map(|inside| f64::from(u8::from(inside)));
        let intervals = before + after;
        Self {
            linear: [before, 2.0 * intervals, after].map(|weight| weight / (3.0 * intervals)),
            second_difference: 2.0 / intervals,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Mean of a function around 0 by Simpson's rule, which is exact for the cubics of this test.
    fn mean(before: bool, after: bool, h: f64, f: impl Fn(f64) -> f64) -> f64 {
        let over = |end: f64| (f(0.0) + 4.0 * 0.5 * f(0.5 * end)) / 6.0;
        let sides: Vec<f64> = [(before, -h), (after, h)]
            .iter()
            .filter(|(inside, _)| *inside)
            .map(|s| over(s.1))
            .collect();
        2.0 * sides.iter().sum::<f64>() / sides.len() as f64
    }

    #[test]
    fn means_are_those_of_a_spline_with_linear_accelerations() {
        let h = 0.1;
        // Cubics with the same value, slope and second derivative at 0 and different third derivatives on both sides.
        let third = |t: f64| if t < 0.0 { -7.0 } else { 4.0 };
        let x = |t: f64| 0.2 + 0.5 * t + 0.5 * 3.0 * t * t + third(t) * t * t * t / 6.0;
        let acceleration = |t: f64| 3.0 + third(t) * t;
        for (before, after) in [(true, true), (true, false), (false, true)] {
            let means = MeanWeights::new(before, after);
            let expected = mean(before, after, h, acceleration);
            let at = |inside: bool, t: f64| if inside { x(t) } else { 0.2 + 0.5 * t };
            let difference = (at(before, -h) - 2.0 * x(0.0) + at(after, h)) / (h * h);
            assert!((means.second_difference * difference - expected).abs() < 1e-12);
            let [w0, w1, w2] = means.linear;
            let linear = w0 * acceleration(-h) + w1 * acceleration(0.0) + w2 * acceleration(h);
            assert!((linear - expected).abs() < 1e-12); // rounding only
        }
    }
}
