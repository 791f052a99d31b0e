//! Random-effects mean of a value from several sources that disagree by more than their standard deviations.
//!
//! Source k reports the value y with the standard deviation s. The model assumes that each source measures its own value, y ~
//! N(θ, s²), and that these values scatter around the true one, θ ~ N(μ, τ²). DerSimonian and Laird (1986, Controlled Clinical
//! Trials 7, 177–188) estimate τ² from Cochran's Q = Σ w (y − m)², where w = 1/s² and m is the mean with these weights. For n
//! sources that differ only by their standard deviations, Q is n − 1 on average. Hence
//!
//! τ² = max(0, (Q − (n − 1)) / (Σ w − Σ w² / Σ w)),
//!
//! and μ is the mean with the weights 1/(s² + τ²). Its variance is 1/Σ 1/(s² + τ²).
//!
//! Birge's ratio (1932, Phys. Rev. 40, 207) would multiply all standard deviations by √(Q/(n − 1)) instead. The source with the
//! smallest standard deviation would then still dominate, whereas τ² makes the weights of disagreeing sources nearly equal.

/// Reported value of a source, and its standard deviation.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct SourceEstimate {
    pub value: f64,
    pub deviation: f64,
}

impl SourceEstimate {
    /// True if value and standard deviation are finite and the standard deviation is positive. Other reports have no weight.
    pub fn is_known(&self) -> bool {
        self.value.is_finite() && self.deviation.is_finite() && self.deviation > 0.0
    }
}

/// Mean of several sources.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Mean {
    pub value: f64,
    /// Standard deviation of a further source's value from the mean: √(1/Σ 1/(s² + τ²) + τ²).
    ///
    /// This is the prediction of Higgins, Thompson and Spiegelhalter (2009, J. R. Statist. Soc. A 172, 137–159). The standard
    /// deviation of the mean itself would be too small, because it assumes independent model errors that average out.
    pub deviation: f64,
    /// Standard deviation τ of the differences between sources that their own deviations do not explain.
    pub between: f64,
}

/// Mean of the known reports; `None` without known reports.
pub(super) fn mean(reports: &[SourceEstimate]) -> Option<Mean> {
    let known: Vec<SourceEstimate> =
        reports.iter().filter(|report| report.is_known()).copied().collect();
    if known.is_empty() {
        return None;
    }
    let between = between(&known);
    let (value, weights) = weighted(&known, between);
    Some(Mean { value, deviation: (1.0 / weights).sqrt().hypot(between), between })
}

/// Standard deviation τ of the differences between sources that their own deviations do not explain. 0 with fewer than two known
/// reports.
pub(super) fn between(reports: &[SourceEstimate]) -> f64 {
    let known: Vec<SourceEstimate> =
        reports.iter().filter(|report| report.is_known()).copied().collect();
    if known.len() < 2 {
        return 0.0;
    }
    let (mean, weights) = weighted(&known, 0.0);
    let sum = |of: &dyn Fn(f64, f64) -> f64| -> f64 {
        known.iter().map(|report| of(report.deviation.powi(-2), report.value - mean)).sum()
    };
    let off = sum(&|weight, off| weight * off * off);
    let own = weights - sum(&|weight, _| weight * weight) / weights;
    ((off - (known.len() - 1) as f64) / own).max(0.0).sqrt()
}

/// Mean with the weights 1/(s² + τ²), and the sum of the weights.
fn weighted(known: &[SourceEstimate], between: f64) -> (f64, f64) {
    let weight = |report: &SourceEstimate| (report.deviation.powi(2) + between * between).recip();
    let weights: f64 = known.iter().map(weight).sum();
    let sum: f64 = known.iter().map(|report| weight(report) * report.value).sum();
    (sum / weights, weights)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn reports<const N: usize>(of: [(f64, f64); N]) -> [SourceEstimate; N] {
        of.map(|(value, deviation)| SourceEstimate { value, deviation })
    }

    fn near(found: f64, expected: f64) {
        assert!((found - expected).abs() < 1e-12 * expected.abs().max(1.0), "{found}, {expected}");
    }

    #[test]
    fn two_that_disagree_have_the_closed_form() {
        // 9 and 11 have a variance of 2, of which 1 is their own.
        let found = mean(&reports([(9.0, 1.0), (11.0, 1.0)])).unwrap();
        near(found.value, 10.0);
        near(found.between, 1.0);
        // 1/Σ 1/(1 + 1), and 1.
        near(found.deviation, 2.0_f64.sqrt());
    }

    #[test]
    fn unequal_deviations_have_the_closed_form() {
        // Weights 1 and 1/4, mean 1.6, Q = 1.6² + 6.4²/4 = 12.8, Σw − Σw²/Σw = 1.25 − 1.0625/1.25 = 0.4.
        let found = mean(&reports([(0.0, 1.0), (8.0, 2.0)])).unwrap();
        let variance: f64 = (12.8 - 1.0) / 0.4;
        near(found.between, variance.sqrt());
        let weights = [1.0 / (1.0 + variance), 1.0 / (4.0 + variance)];
        near(found.value, 8.0 * weights[1] / (weights[0] + weights[1]));
        near(found.deviation, (1.0 / (weights[0] + weights[1]) + variance).sqrt());
    }

    #[test]
    fn equal_reports_narrow_as_independent_ones_do_and_not_below() {
        for count in [1, 2, 4, 9] {
            let found = mean(&vec![SourceEstimate { value: 3.0, deviation: 0.6 }; count]).unwrap();
            near(found.value, 3.0);
            near(found.between, 0.0);
            near(found.deviation, 0.6 / (count as f64).sqrt());
        }
    }

    #[test]
    fn an_outlier_widens_beyond_what_any_source_reports() {
        let agreeing = mean(&reports([(1.0, 0.1), (1.1, 0.1), (0.9, 0.1)])).unwrap();
        let found = mean(&reports([(1.0, 0.1), (1.1, 0.1), (0.9, 0.1), (3.0, 0.1)])).unwrap();
        assert!(agreeing.deviation < 0.1, "{agreeing:?}");
        // Deviation of the four values: 1.0017.
        assert!(found.deviation > 1.0, "{found:?}");
        assert!((1.0..2.0).contains(&found.value), "{found:?}");
    }

    #[test]
    fn the_smallest_deviation_does_not_decide_among_sources_that_disagree() {
        let found = mean(&reports([(1.0, 0.001), (2.0, 0.1), (3.0, 0.1)])).unwrap();
        assert!((found.value - 2.0).abs() < 0.01, "{found:?}");
        // The opposite holds for values that agree.
        let found = mean(&reports([(1.0, 0.001), (1.05, 0.1), (0.95, 0.1)])).unwrap();
        assert!((found.value - 1.0).abs() < 1e-4, "{found:?}");
    }

    #[test]
    fn order_and_unit_do_not_matter() {
        let of = [(9.0, 1.0), (12.0, 0.5), (10.0, 2.0)];
        let one = mean(&reports(of)).unwrap();
        let [first, second, third] = of;
        let other = mean(&reports([third, first, second])).unwrap();
        near(one.value, other.value);
        near(one.deviation, other.deviation);
        let scaled = mean(&reports(of.map(|(value, by)| (1e3 * value, 1e3 * by)))).unwrap();
        near(scaled.value, 1e3 * one.value);
        near(scaled.deviation, 1e3 * one.deviation);
    }

    #[test]
    fn sources_without_a_deviation_do_not_count() {
        let unknown = [f64::INFINITY, f64::NAN, 0.0, -1.0];
        let unknown = unknown.map(|deviation| SourceEstimate { value: 99.0, deviation });
        assert_eq!(mean(&unknown), None);
        assert_eq!(mean(&[]), None);
        let known = reports([(9.0, 1.0), (11.0, 1.0)]);
        assert_eq!(mean(&[&known[..], &unknown].concat()), mean(&known));
        assert_eq!(between(&[&known[..1], &unknown].concat()), 0.0);
    }
}
