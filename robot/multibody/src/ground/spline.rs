//! Cubic B-splines through regular samples. They have continuous second derivatives, so that contacts have continuous
//! derivatives.

use std::fmt;

/// Minimum number of samples along each axis.
pub(super) const LEAST: usize = 4;

/// Reason for which samples are not a valid field.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum FieldError {
    /// Too few samples.
    #[error("{count} samples along axis {axis}; expected 4 or more")]
    Few {
        /// Index of the axis.
        axis: usize,
        /// Number of samples along the axis.
        count: usize,
    },
    /// Spacing that is not positive.
    #[error("spacing_m is {spacing_m}; expected a value above 0 m")]
    Spacing {
        /// Distance between samples, m.
        spacing_m: f64,
    },
    /// Number of samples that differs from the product of the counts.
    #[error("{found} samples; expected {wanted}, the product of the counts")]
    Length {
        /// Number of samples.
        found: usize,
        /// Product of the counts.
        wanted: usize,
    },
    /// Sample that is not a finite number.
    #[error("sample {index} is {value}; expected a finite number in m")]
    Value {
        /// Index of the sample.
        index: usize,
        /// Value of the sample.
        value: f64,
    },
    /// Origin that is not finite.
    #[error("origin_m is {origin_m:?}; expected finite numbers in m")]
    Origin {
        /// Position of the first sample, m.
        origin_m: [f64; 2],
    },
    /// Elevation map without a known height.
    #[error("no height is known; expected a finite number in m for one cell or more")]
    Unknown,
    /// Solid that extends to the boundary of the grid.
    #[error(
        "sample {index} near the boundary of the grid is {value} m; enlarge the grid until its two \
         outermost layers of samples are above 0 m"
    )]
    Cut {
        /// Index of the sample.
        index: usize,
        /// Value of the sample.
        value: f64,
    },
}

/// Spline coefficients on a regular lattice, with the first axis varying fastest.
#[derive(Clone, PartialEq)]
pub(super) struct Lattice<const N: usize> {
    /// Position of the first coefficient, one spacing before the first sample.
    pub origin: [f64; N],
    pub spacing_m: f64,
    /// Number of coefficients along each axis, two more than samples.
    pub counts: [usize; N],
    /// Coefficients of the spline.
    coefficients: Vec<f64>,
}

/// Cell of a lattice along one axis, and the splines over it.
#[derive(Clone, Copy)]
pub(super) struct Basis {
    first: usize,
    /// Values of the four splines, with their first and second derivatives with respect to the coordinate.
    pub weights: [[f64; LEAST]; 3],
}

impl<const N: usize> fmt::Debug for Lattice<N> {
    /// Prints counts, origin and spacing without the coefficients.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let &Self { origin, spacing_m, counts, .. } = self;
        write!(f, "Lattice {{ {counts:?} from {origin:?} m, {spacing_m} m apart }}")
    }
}

impl<const N: usize> Lattice<N> {
    pub fn new(
        origin: [f64; N],
        spacing_m: f64,
        counts: [usize; N],
        samples: Vec<f64>,
    ) -> Result<Self, FieldError> {
        if !(spacing_m > 0.0 && spacing_m.is_finite()) {
            return Err(FieldError::Spacing { spacing_m });
        }
        if let Some((axis, &count)) = counts.iter().enumerate().find(|(_, count)| **count < LEAST) {
            return Err(FieldError::Few { axis, count });
        }
        let (found, wanted) = (samples.len(), counts.iter().product());
        if found != wanted {
            return Err(FieldError::Length { found, wanted });
        }
        let none = samples.iter().enumerate().find(|(_, value)| !value.is_finite());
        if let Some((index, &value)) = none {
            return Err(FieldError::Value { index, value });
        }
        let mut coefficients = padded(&samples, counts);
        let origin = origin.map(|first| first - spacing_m);
        let counts = counts.map(|count| count + 2);
        let (mut stride, mut line) = (1, Vec::new());
        for count in counts {
            for first in 0..coefficients.len() {
                // Start of a line along the axis. Lines beyond the samples of later axes are 0, and remain 0.
                if (first / stride).is_multiple_of(count) {
                    line.clear();
                    line.extend((0..count).map(|k| coefficients[first + stride * k]));
                    interpolate(&mut line);
                    for (k, value) in line.iter().enumerate() {
                        coefficients[first + stride * k] = *value;
                    }
                }
            }
            stride *= count;
        }
        Ok(Self { origin, spacing_m, counts, coefficients })
    }

    /// Coordinates of the first and the final sample along an axis, m. The spline is defined between them.
    pub fn range(&self, axis: usize) -> [f64; 2] {
        [1, self.counts[axis] - 2].map(|k| self.origin[axis] + self.spacing_m * k as f64)
    }

    /// Evaluates the splines at a coordinate within the range of an axis.
    pub fn basis(&self, axis: usize, coordinate_m: f64) -> Basis {
        let at = (coordinate_m - self.origin[axis]) / self.spacing_m;
        let cell = (at.floor() as usize).clamp(1, self.counts[axis] - 3);
        let t = at - cell as f64;
        let s = 1.0 - t;
        let values = [
            s * s * s,
            3.0 * t * t * t - 6.0 * t * t + 4.0,
            3.0 * s * s * s - 6.0 * s * s + 4.0,
            t * t * t,
        ];
        let slopes = [-s * s, 3.0 * t * t - 4.0 * t, -3.0 * s * s + 4.0 * s, t * t];
        let bends = [s, 3.0 * t - 2.0, 3.0 * s - 2.0, t];
        let per_m = 1.0 / self.spacing_m;
        let weights = [
            values.map(|value| value / 6.0),
            slopes.map(|slope| 0.5 * slope * per_m),
            bends.map(|bend| bend * per_m * per_m),
        ];
        Basis { first: cell - 1, weights }
    }

    /// Weighted sum of the coefficients around a point. `orders` has the order of the splines' derivative along each axis.
    pub fn sum(&self, bases: &[Basis; N], orders: [usize; N]) -> f64 {
        let mut sum = 0.0;
        for corner in 0..LEAST.pow(N as u32) {
            let (mut index, mut stride, mut weight, mut rest) = (0, 1, 1.0, corner);
            for axis in 0..N {
                let k = rest % LEAST;
                rest /= LEAST;
                weight *= bases[axis].weights[orders[axis]][k];
                index += stride * (bases[axis].first + k);
                stride *= self.counts[axis];
            }
            sum += weight * self.coefficients[index];
        }
        sum
    }
}

/// Replaces samples along one axis by the coefficients of the natural spline through them, whose second derivative is 0 at both
/// ends. The first and the final entry of `line` are beyond the samples.
fn interpolate(line: &mut [f64]) {
    let last = line.len() - 2;
    // c(k−1) + 4 c(k) + c(k+1) = 6 f(k), and at the ends c = f: elimination from the front.
    let mut over = vec![0.0; line.len()];
    for k in 2..last {
        let pivot = 4.0 - over[k - 1];
        over[k] = 1.0 / pivot;
        line[k] = (6.0 * line[k] - line[k - 1]) / pivot;
    }
    for k in (2..last).rev() {
        line[k] -= over[k] * line[k + 1];
    }
    line[0] = 2.0 * line[1] - line[2];
    line[last + 1] = 2.0 * line[last] - line[last - 1];
}

/// Copies samples into a lattice with one additional entry at both ends of each axis.
fn padded<const N: usize>(samples: &[f64], counts: [usize; N]) -> Vec<f64> {
    let mut all = vec![0.0; counts.iter().map(|count| count + 2).product()];
    for (number, sample) in samples.iter().enumerate() {
        let (mut index, mut stride, mut rest) = (0, 1, number);
        for count in counts {
            index += stride * (rest % count + 1);
            rest /= count;
            stride *= count + 2;
        }
        all[index] = *sample;
    }
    all
}
