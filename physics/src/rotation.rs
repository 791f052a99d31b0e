//! Rotation increments: exponential map of SO(3) and its left Jacobian, as series.
//!
//! Nine terms are exact to rounding for increments up to 1 rad. A Newton iteration changes an increment by at most 0.3 rad. A
//! series has no branch and no division 0/0, so that its derivatives are exact as well.

use nalgebra::{Matrix3, Vector3};
use rollwalk_multibody::rotation::skew;

/// Number of terms in a series.
const TERMS: usize = 9;

/// Increment φ, rad, with coefficients of the exponential map.
#[derive(Clone, Copy, Debug)]
pub struct Increment {
    phi: Vector3<f64>,
    cross: Matrix3<f64>,
    /// Coefficients sin t / t, (1 − cos t)/t² and (t − sin t)/t³ with t = |φ|.
    coefficients: [f64; 3],
    /// Derivatives of the second and third coefficient with respect to t².
    slopes: [f64; 2],
}

/// Series Σ (−s)^k / (2k + first)!, as its first coefficient and the quotients of successive coefficients.
struct Series {
    first: f64,
    quotients: [f64; TERMS],
}

impl Series {
    const fn new(first: usize) -> Self {
        let (mut factorial, mut k) = (1, 1);
        while k <= first {
            factorial *= k;
            k += 1;
        }
        let mut quotients = [0.0; TERMS];
        k = 0;
        while k < TERMS {
            quotients[k] = -1.0 / ((2 * k + first + 1) * (2 * k + first + 2)) as f64;
            k += 1;
        }
        Self { first: 1.0 / factorial as f64, quotients }
    }

    /// Value of the series, and its derivative with respect to `s`.
    fn at(&self, s: f64) -> (f64, f64) {
        // Horner's scheme from the last term.
        let (mut value, mut slope) = (0.0, 0.0);
        for quotient in self.quotients.iter().rev() {
            slope = (value + s * slope) * quotient;
            value = 1.0 + s * value * quotient;
        }
        (value * self.first, slope * self.first)
    }
}

/// Series of sin t / t, (1 − cos t)/t² and (t − sin t)/t³ in s = t².
const SERIES: [Series; 3] = [Series::new(1), Series::new(2), Series::new(3)];

impl Increment {
    /// Creates the increment φ in world axes, rad.
    pub fn new(phi: Vector3<f64>) -> Self {
        let s = phi.norm_squared();
        let [(sine, _), (cosine, cosine_slope), (rest, rest_slope)] = SERIES.map(|of| of.at(s));
        Self {
            phi,
            cross: skew(&phi),
            coefficients: [sine, cosine, rest],
            slopes: [cosine_slope, rest_slope],
        }
    }

    /// Rotation matrix Exp(φ), which rotates about φ by the angle |φ|.
    pub fn rotation(&self) -> Matrix3<f64> {
        let [a, b, _] = self.coefficients;
        Matrix3::identity() + self.cross * a + self.cross * self.cross * b
    }

    /// Left Jacobian J_l: Exp(φ + δ) = Exp(J_l δ) Exp(φ) to first order.
    pub fn left_jacobian(&self) -> Matrix3<f64> {
        let [_, a, b] = self.coefficients;
        Matrix3::identity() + self.cross * a + self.cross * self.cross * b
    }

    /// Product J_l(φ) v.
    pub fn left_jacobian_times(&self, v: &Vector3<f64>) -> Vector3<f64> {
        let [_, a, b] = self.coefficients;
        let once = self.phi.cross(v);
        v + once * a + self.phi.cross(&once) * b
    }

    /// Derivative of the product J_l(φ) v with respect to φ.
    pub fn left_jacobian_times_by_phi(&self, v: &Vector3<f64>) -> Matrix3<f64> {
        let ([_, a, b], [da, db]) = (self.coefficients, self.slopes);
        let once = self.phi.cross(v);
        let twice = self.phi.cross(&once);
        // [φ]² v = φ (φ·v) − v φ·φ.
        let of_twice = Matrix3::identity() * self.phi.dot(v) + self.phi * v.transpose()
            - v * self.phi.transpose() * 2.0;
        -skew(v) * a
            + once * self.phi.transpose() * (2.0 * da)
            + of_twice * b
            + twice * self.phi.transpose() * (2.0 * db)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Rotation3;

    fn vectors() -> impl Iterator<Item = Vector3<f64>> {
        let mut rng = fastrand::Rng::with_seed(3);
        let mut number = move || 2.0 * rng.f64() - 1.0;
        let sizes = [0.0, 1e-9, 1e-4, 0.1, 0.3, 1.0];
        sizes
            .into_iter()
            .map(move |size| Vector3::new(number(), number(), number()).normalize() * size)
    }

    #[test]
    fn exp_is_the_rotation_about_the_increment() {
        for phi in vectors() {
            let error = Increment::new(phi).rotation() - Rotation3::new(phi).into_inner();
            assert!(error.norm() < 1e-14, "{phi:?}");
        }
    }

    #[test]
    fn the_left_jacobian_is_the_derivative_of_exp() {
        let step = 1e-6;
        for phi in vectors() {
            let jacobian = Increment::new(phi).left_jacobian();
            let inverse = Increment::new(phi).rotation().transpose();
            for axis in 0..3 {
                let along = |h: f64| {
                    let mut phi = phi;
                    phi[axis] += h;
                    Increment::new(phi).rotation()
                };
                let rate = (along(step) - along(-step)) * inverse / (2.0 * step);
                let error = rate - skew(&jacobian.column(axis).into_owned());
                assert!(error.norm() < 1e-9, "{phi:?}");
            }
        }
    }

    #[test]
    fn the_derivative_of_the_left_jacobian_agrees_with_finite_differences() {
        let (v, step) = (Vector3::new(0.3, -0.7, 0.2), 1e-6);
        for phi in vectors() {
            let value = Increment::new(phi).left_jacobian_times(&v);
            assert!((value - Increment::new(phi).left_jacobian() * v).norm() < 1e-15);
            let derivative = Increment::new(phi).left_jacobian_times_by_phi(&v);
            for axis in 0..3 {
                let along = |h: f64| {
                    let mut phi = phi;
                    phi[axis] += h;
                    Increment::new(phi).left_jacobian() * v
                };
                let rate = (along(step) - along(-step)) / (2.0 * step);
                assert!((rate - derivative.column(axis)).norm() < 1e-9, "{phi:?}");
            }
        }
    }
}
