//! Cubic splines with two continuous derivatives through equally spaced samples.
//!
//! Values are complex, so that a pair of horizontal coordinates is one curve that a multiplication turns about the vertical.
//! Scalars use the real part. With slopes s at the knots, continuity of the second derivative requires
//!
//! ```text
//! s_{i-1} + 4 s_i + s_{i+1} = 3 (v_{i+1} − v_{i-1}) / h
//! ```
//!
//! A periodic curve continues in its next period as v(t + H) = turn · v(t) + shift with |turn| = 1. Its two derivatives are
//! turned likewise. Tests compare the splines with cubics, sines and their derivatives.
//!
//! Between the 60 Hz frames of this curve, the firmware plays cubics with slopes from neighbouring frames, in `f32`
//! (`firmware/src/hermite.rs`).

use nalgebra::Complex;

/// Value, first and second derivative of a curve at one time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Jet {
    /// Value.
    pub value: Complex<f64>,
    /// First derivative per second.
    pub rate: Complex<f64>,
    /// Second derivative per second squared.
    pub acceleration: Complex<f64>,
}

/// Cubic spline over [0, spacing · intervals].
#[derive(Clone, Debug, PartialEq)]
pub struct Spline {
    spacing: f64,
    values: Vec<Complex<f64>>,
    slopes: Vec<Complex<f64>>,
}

impl Spline {
    /// Creates a spline through one period of `values`, at least three. The curve continues as v(t + H) = `turn` · v(t) +
    /// `shift`.
    pub fn periodic(
        spacing: f64,
        values: &[Complex<f64>],
        turn: Complex<f64>,
        shift: Complex<f64>,
    ) -> Self {
        let count = values.len();
        let mut knots = values.to_vec();
        knots.push(turn * values[0] + shift);
        let before = turn.conj() * (values[count - 1] - shift);
        let rhs = (0..count)
            .map(|i| {
                let previous = if i == 0 { before } else { knots[i - 1] };
                (knots[i + 1] - previous) * (3.0 / spacing)
            })
            .collect();
        let mut slopes = solve_cyclic(rhs, turn);
        slopes.push(turn * slopes[0]);
        Self { spacing, values: knots, slopes }
    }

    /// Creates a spline through `values`, at least two, with given slopes at its ends.
    pub fn clamped(
        spacing: f64,
        values: &[Complex<f64>],
        start_slope: Complex<f64>,
        end_slope: Complex<f64>,
    ) -> Self {
        let last = values.len() - 1;
        let mut rhs: Vec<_> =
            (1..last).map(|i| (values[i + 1] - values[i - 1]) * (3.0 / spacing)).collect();
        if let Some(first) = rhs.first_mut() {
            *first -= start_slope;
        }
        if let Some(last) = rhs.last_mut() {
            *last -= end_slope;
        }
        let mut slopes = vec![start_slope];
        slopes.extend(solve_tridiagonal(&vec![4.0; rhs.len()], rhs));
        slopes.push(end_slope);
        Self { spacing, values: values.to_vec(), slopes }
    }

    /// Value and derivatives at `time` after the first knot, s. Beyond the ends, the curve continues with its slope there.
    pub fn at(&self, time: f64) -> Jet {
        let h = self.spacing;
        let last_interval = self.values.len() - 2;
        let inside = time.clamp(0.0, h * (last_interval + 1) as f64);
        if inside != time {
            let end = self.at(inside);
            let value = end.value + end.rate * (time - inside);
            return Jet { value, rate: end.rate, acceleration: Complex::default() };
        }
        let i = ((time / h).floor().max(0.0) as usize).min(last_interval);
        let u = time / h - i as f64;
        let (v0, v1) = (self.values[i], self.values[i + 1]);
        let (s0, s1) = (self.slopes[i] * h, self.slopes[i + 1] * h);
        // v0 + s0·u + b·u² + a·u³ on the interval.
        let b = (v1 - v0) * 3.0 - s0 * 2.0 - s1;
        let a = (v0 - v1) * 2.0 + s0 + s1;
        Jet {
            value: v0 + (s0 + (b + a * u) * u) * u,
            rate: (s0 + (b * 2.0 + a * (3.0 * u)) * u) / h,
            acceleration: (b * 2.0 + a * (6.0 * u)) / (h * h),
        }
    }
}

/// Solves rows x_{i-1} + d_i x_i + x_{i+1} = r_i (no neighbour beyond the ends) by elimination.
fn solve_tridiagonal(diagonal: &[f64], mut rhs: Vec<Complex<f64>>) -> Vec<Complex<f64>> {
    let mut pivots = diagonal.to_vec();
    for i in 1..rhs.len() {
        let factor = 1.0 / pivots[i - 1];
        pivots[i] -= factor;
        let carried = rhs[i - 1] * factor;
        rhs[i] -= carried;
    }
    for i in (0..rhs.len()).rev() {
        let next = rhs.get(i + 1).copied().unwrap_or_default();
        rhs[i] = (rhs[i] - next) / pivots[i];
    }
    rhs
}

/// Solves x_{i-1} + 4 x_i + x_{i+1} = r_i, where x_{-1} = conj(turn)·x_{n-1} and x_n = turn·x_0.
///
/// By Sherman–Morrison, the matrix is a tridiagonal one plus u·vᵀ with u = (γ, 0, …, turn) and v = (1, 0, …, conj(turn)/γ). γ =
/// −4 keeps the tridiagonal part diagonally dominant.
fn solve_cyclic(rhs: Vec<Complex<f64>>, turn: Complex<f64>) -> Vec<Complex<f64>> {
    const GAMMA: f64 = -4.0;
    let last = rhs.len() - 1;
    let mut diagonal = vec![4.0; rhs.len()];
    diagonal[0] -= GAMMA;
    diagonal[last] -= 1.0 / GAMMA; // turn·conj(turn) = 1
    let mut u = vec![Complex::default(); rhs.len()];
    u[0] = GAMMA.into();
    u[last] = turn;
    let y = solve_tridiagonal(&diagonal, rhs);
    let z = solve_tridiagonal(&diagonal, u);
    let v_last = turn.conj() / GAMMA;
    let factor = (y[0] + v_last * y[last]) / (z[0] + v_last * z[last] + 1.0);
    y.iter().zip(&z).map(|(y, z)| y - z * factor).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::TAU;

    fn real(value: f64) -> Complex<f64> {
        value.into()
    }

    #[test]
    fn a_clamped_spline_reproduces_cubics() {
        let cubic = |t: f64| 0.3 - 1.2 * t + 0.7 * t * t - 0.4 * t * t * t;
        let rate = |t: f64| -1.2 + 1.4 * t - 1.2 * t * t;
        let acceleration = |t: f64| 1.4 - 2.4 * t;
        for intervals in [1, 2, 3, 9] {
            let h = 1.5 / intervals as f64;
            let values: Vec<_> = (0..=intervals).map(|i| real(cubic(i as f64 * h))).collect();
            let spline = Spline::clamped(h, &values, real(rate(0.0)), real(rate(1.5)));
            for k in 0..=60 {
                let t = k as f64 * 0.025;
                let jet = spline.at(t);
                // Rounding of numbers of order 1, divided by h² for the second derivative.
                assert!((jet.value.re - cubic(t)).abs() < 1e-13, "{intervals} {t}");
                assert!((jet.rate.re - rate(t)).abs() < 1e-12, "{intervals} {t}");
                assert!((jet.acceleration.re - acceleration(t)).abs() < 1e-10, "{intervals} {t}");
            }
        }
    }

    /// Largest jump of value, rate and acceleration over the inner knots.
    fn worst_jump(spline: &Spline, intervals: usize, h: f64) -> f64 {
        // The cubic left of a knot is evaluated just before the knot.
        let before = 1.0 - 1e-12;
        (1..intervals)
            .map(|i| {
                let (left, right) =
                    (spline.at(h * (i as f64 - 1.0 + before)), spline.at(h * i as f64));
                (left.value - right.value)
                    .norm()
                    .max((left.rate - right.rate).norm())
                    .max((left.acceleration - right.acceleration).norm())
            })
            .fold(0.0, f64::max)
    }

    #[test]
    fn two_derivatives_are_continuous_at_every_knot() {
        let values: Vec<_> = [0.0, 1.0, -0.5, 0.3, 0.3, 2.0, 1.0].map(real).to_vec();
        let spline = Spline::clamped(0.1, &values, real(3.0), real(-1.0));
        // Third derivatives reach 1e5 here, times the 1e-13 s that separate the two evaluations.
        assert!(worst_jump(&spline, 6, 0.1) < 1e-7);
        let spline = Spline::periodic(0.1, &values, real(1.0), real(0.4));
        assert!(worst_jump(&spline, 7, 0.1) < 1e-7);
    }

    #[test]
    fn a_turning_periodic_curve_meets_its_next_period_in_two_derivatives() {
        let turn = Complex::from_polar(1.0, 0.7);
        let shift = Complex::new(0.4, -0.2);
        let values: Vec<_> =
            (0..7).map(|i| Complex::new((i * i % 5) as f64, (i * 3 % 7) as f64)).collect();
        let spline = Spline::periodic(0.25, &values, turn, shift);
        let (start, end) = (spline.at(0.0), spline.at(7.0 * 0.25));
        // Rounding of numbers of order 1e3 (accelerations).
        assert!((end.value - (turn * start.value + shift)).norm() < 1e-12);
        assert!((end.rate - turn * start.rate).norm() < 1e-11);
        assert!((end.acceleration - turn * start.acceleration).norm() < 1e-9);
    }

    #[test]
    fn a_periodic_spline_follows_a_sine_with_fourth_order() {
        let worst = |count: usize| {
            let h = 1.0 / count as f64;
            let values: Vec<_> = (0..count).map(|i| real((TAU * i as f64 * h).sin())).collect();
            let spline = Spline::periodic(h, &values, real(1.0), real(0.0));
            (0..1000)
                .map(|k| k as f64 / 1000.0)
                .map(|t| (spline.at(t).value.re - (TAU * t).sin()).abs())
                .fold(0.0, f64::max)
        };
        let (coarse, fine) = (worst(12), worst(24));
        // Spline theory: error ≤ (5/384) h⁴ max|f''''|.
        assert!(coarse < 5.0 / 384.0 * (TAU / 12.0).powi(4));
        let order = (coarse / fine).log2();
        assert!((3.8..4.3).contains(&order), "order {order}");
    }
}
