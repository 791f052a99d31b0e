//! Cubic B-splines over regular samples: smooth twice, so that contacts keep continuous derivatives.

use std::fmt;

/// Samples that a spline needs along each axis.
pub(super) const LEAST: usize = 4;

/// Reason for which samples are no field.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum FieldError {
    /// Too few samples.
    #[error("{count} samples along axis {axis}: a spline needs 4 or more")]
    Few {
        /// Axis.
        axis: usize,
        /// Samples along it.
        count: usize,
    },
    /// Spacing that is not positive.
    #[error("spacing_m is {spacing_m}: it must be positive")]
    Spacing {
        /// Distance of samples, m.
        spacing_m: f64,
    },
    /// Number of samples that differs from the product of the counts.
    #[error("{found} samples where the counts ask for {wanted}")]
    Length {
        /// Samples.
        found: usize,
        /// Product of the counts.
        wanted: usize,
    },
    /// A sample that is no number.
    #[error("sample {index} is {value}: it must be a finite number, in metres")]
    Value {
        /// Index of the sample.
        index: usize,
        /// Value of the sample.
        value: f64,
    },
    /// A solid that its grid cuts.
    #[error(
        "sample {index} at the boundary of the grid is {value} m: solids must lie within, with room around them"
    )]
    Cut {
        /// Index of the sample.
        index: usize,
        /// Value of the sample.
        value: f64,
    },
}

/// Samples along axes, the first axis fastest.
#[derive(Clone, PartialEq)]
pub(super) struct Lattice<const N: usize> {
    /// Position of the first coefficient, one place before the first sample.
    pub origin: [f64; N],
    pub spacing_m: f64,
    /// Coefficients along each axis, two more than samples.
    pub counts: [usize; N],
    /// Coefficients of the spline.
    coefficients: Vec<f64>,
}

/// A cell of a lattice and the splines over it, along one axis.
#[derive(Clone, Copy)]
pub(super) struct Basis {
    first: usize,
    /// The four splines, their first and their second derivatives by the coordinate.
    pub weights: [[f64; LEAST]; 3],
}

impl<const N: usize> fmt::Debug for Lattice<N> {
    /// Leaves out the coefficients, which are many.
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
                // Where a line along the axis begins. Lines beyond the samples along later axes are 0, and stay so.
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

    /// Coordinates of the first and the last sample along an axis, m, between which the spline is defined.
    pub fn range(&self, axis: usize) -> [f64; 2] {
        [1, self.counts[axis] - 2].map(|k| self.origin[axis] + self.spacing_m * k as f64)
    }

    /// The splines at a coordinate within the range of an axis.
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

    /// Sum of the coefficients around a point, weighted along each axis by a derivative of the splines of that order.
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

/// Turns samples along one axis into the coefficients of the natural spline through them: its second derivative is 0 at both
/// ends. Of a line, the first and the last place are beyond the samples.
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

/// Copies samples into a lattice with one more place at both ends of each axis.
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
