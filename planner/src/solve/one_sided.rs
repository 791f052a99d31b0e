//! Smoothed one-sided square of Eq. 2.16.

/// Function ψ_ε(x) with its first two derivatives: 0 below −ε, x² + ε²/3 above ε, a cubic between. The second derivative is
/// continuous.
pub fn one_sided_square(x: f64, band: f64) -> [f64; 3] {
    if x <= -band {
        [0.0; 3]
    } else if x < band {
        let value = x.powi(3) / (6.0 * band) + x * x / 2.0 + band * x / 2.0 + band * band / 6.0;
        [value, x * x / (2.0 * band) + x + band / 2.0, x / band + 1.0]
    } else {
        [x * x + band * band / 3.0, 2.0 * x, 2.0]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pieces_meet_twice_differentiably() {
        let band = 0.3;
        for seam in [-band, band] {
            let (below, above) =
                (one_sided_square(seam - 1e-12, band), one_sided_square(seam + 1e-12, band));
            for (b, a) in below.iter().zip(above) {
                assert!((b - a).abs() < 1e-10); // 2e-12 apart with slopes below 10
            }
        }
    }

    #[test]
    fn derivatives_match_differences() {
        let band = 0.3;
        for x in [-0.5, -0.2, 0.0, 0.1, 0.29, 0.7] {
            let step = 1e-6;
            let [_, first, second] = one_sided_square(x, band);
            let (p, m) = (one_sided_square(x + step, band), one_sided_square(x - step, band));
            assert!(((p[0] - m[0]) / (2.0 * step) - first).abs() < 1e-8);
            assert!(((p[1] - m[1]) / (2.0 * step) - second).abs() < 1e-6);
        }
    }
}
