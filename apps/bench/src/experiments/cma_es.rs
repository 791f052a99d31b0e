//! Evolution strategy with covariance matrix adaptation (CMA-ES), as a reference that needs no derivatives (Hansen, "The CMA
//! Evolution Strategy: A Tutorial", 2016).
//!
//! This implementation has rank-one and rank-μ updates with positive weights and the tutorial's constants. The only crate that
//! provides CMA-ES, `cmaes`, has not been maintained since 2022, and depends on a second nalgebra and a second random
//! generator.

use nalgebra::{DMatrix, DVector};

/// Result of the strategy.
#[derive(Clone, Debug)]
pub struct SearchResult {
    pub parameters: Vec<f64>,
    /// Best objective after each sample.
    pub best: Vec<f64>,
}

/// Minimises an objective with at most `samples` samples, from a mean and a standard deviation in each direction.
///
/// Failed evaluations count as infinite. Ends early when the objective reaches `cost`. Returns `None` if `goes_on` returns
/// false.
pub fn minimise(
    mean: &[f64],
    deviation: f64,
    samples: usize,
    cost: f64,
    seed: u64,
    mut run: impl FnMut(&[f64]) -> f64,
    goes_on: impl Fn(&[f64]) -> bool,
) -> Option<SearchResult> {
    let mut rng = fastrand::Rng::with_seed(seed);
    let n = mean.len();
    let size = n as f64;
    let population = 4 + (3.0 * size.ln()).floor() as usize;
    let parents = population / 2;
    let weights = DVector::from_fn(parents, |k, _| {
        (0.5 * (population as f64 + 1.0)).ln() - (k as f64 + 1.0).ln()
    });
    let weights = &weights / weights.sum();
    let effective = 1.0 / weights.norm_squared();
    let cumulation = (4.0 + effective / size) / (size + 4.0 + 2.0 * effective / size);
    let step_cumulation = (effective + 2.0) / (size + effective + 5.0);
    let rank_one = 2.0 / ((size + 1.3).powi(2) + effective);
    let rank_mu = (2.0 * (effective - 2.0 + 1.0 / effective) / ((size + 2.0).powi(2) + effective))
        .min(1.0 - rank_one);
    let excess = (((effective - 1.0) / (size + 1.0)).sqrt() - 1.0).max(0.0);
    let damping = 1.0 + 2.0 * excess + step_cumulation;
    let expected = size.sqrt() * (1.0 - 1.0 / (4.0 * size) + 1.0 / (21.0 * size * size));

    let mut mean = DVector::from_column_slice(mean);
    let mut sigma = deviation;
    let mut covariance = DMatrix::<f64>::identity(n, n);
    let [mut path, mut step_path] = [0; 2].map(|_| DVector::<f64>::zeros(n));
    let mut found = SearchResult { parameters: mean.as_slice().to_vec(), best: Vec::new() };
    for generation in 1.. {
        let eigen = covariance.clone().symmetric_eigen();
        let scales = eigen.eigenvalues.map(|value| value.max(0.0).sqrt());
        let mut ranked = Vec::with_capacity(population);
        for _ in 0..population {
            if found.best.len() >= samples {
                return Some(found);
            }
            let normal = DVector::from_fn(n, |_, _| normal(&mut rng));
            let step = &eigen.eigenvectors * scales.component_mul(&normal);
            let at = &mean + &step * sigma;
            let value = run(at.as_slice());
            let value = if value.is_nan() { f64::INFINITY } else { value };
            let so_far = found.best.last().copied().unwrap_or(f64::INFINITY);
            if value < so_far {
                found.parameters = at.as_slice().to_vec();
            }
            found.best.push(value.min(so_far));
            if value <= cost {
                return Some(found);
            }
            ranked.push((value, step));
        }
        if !goes_on(&found.best) {
            return None;
        }
        ranked.sort_by(|one, other| one.0.total_cmp(&other.0));
        let best = || ranked.iter().zip(&weights).map(|((_, step), weight)| (step, *weight));
        let mean_step: DVector<f64> = best().map(|(step, weight)| step * weight).sum();
        mean += &mean_step * sigma;
        let inverse = scales.map(|scale| if scale > 0.0 { 1.0 / scale } else { 0.0 });
        let whitened =
            &eigen.eigenvectors * inverse.component_mul(&eigen.eigenvectors.tr_mul(&mean_step));
        step_path = step_path * (1.0 - step_cumulation)
            + whitened * (step_cumulation * (2.0 - step_cumulation) * effective).sqrt();
        let settled = 1.0 - (1.0 - step_cumulation).powi(2 * generation);
        let holds = step_path.norm() / settled.sqrt() < (1.4 + 2.0 / (size + 1.0)) * expected;
        let share = if holds { 1.0 } else { 0.0 };
        path = path * (1.0 - cumulation)
            + &mean_step * (share * (cumulation * (2.0 - cumulation) * effective).sqrt());
        let lost = (1.0 - share) * cumulation * (2.0 - cumulation);
        covariance *= 1.0 - rank_one * (1.0 - lost) - rank_mu;
        covariance += &path * path.transpose() * rank_one;
        for (step, weight) in best() {
            covariance += step * step.transpose() * (rank_mu * weight);
        }
        sigma *= (step_cumulation / damping * (step_path.norm() / expected - 1.0)).exp();
    }
    None
}

/// Draws from the standard normal distribution (Box–Muller).
fn normal(rng: &mut fastrand::Rng) -> f64 {
    let radius = (-2.0 * (1.0 - rng.f64()).ln()).sqrt();
    radius * (std::f64::consts::TAU * rng.f64()).cos()
}

#[cfg(test)]
mod tests {
    use super::minimise;

    /// Tests an ellipsoid whose axes differ by a factor of a thousand. Without adaptation these samples would not suffice.
    #[test]
    fn it_adapts_to_an_ellipsoid() {
        let cost = |p: &[f64]| {
            let (along, across) = (p[0] + p[1], p[0] - p[1]);
            1e6 * across * across + along * along + p[2] * p[2]
        };
        let found = minimise(&[3.0, -1.0, 2.0], 0.5, 3000, 1e-14, 1, cost, |_| true).unwrap();
        assert!(cost(&found.parameters) <= 1e-14, "{:?}", found.parameters);
        assert!(minimise(&[1.0], 0.5, 100, 0.0, 1, |p| p[0] * p[0], |_| false).is_none());
    }
}
