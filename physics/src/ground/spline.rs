//! Cubic B-splines over regular samples: smooth twice, so that contacts keep continuous derivatives.

use std::fmt;

/// Samples that a spline needs along each axis.
pub(super) const LEAST: usize = 4;

/// Why samples are no field.
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
    /// No spacing.
    #[error("spacing_m is {spacing_m}: it must be positive")]
    Spacing {
        /// Distance of samples, m.
        spacing_m: f64,
    },
    /// Not the number of samples that the counts say.
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
        /// Its value.
        value: f64,
    },
    /// A solid that its grid cuts.
    #[error(
        "sample {index} at the boundary of the grid is {value} m: solids must lie within, with room around them"
    )]
    Cut {
        /// Index of the sample.
        index: usize,
        /// Its value.
        value: f64,
    },
}

/// Samples along axes, the first axis fastest.
#[derive(Clone, PartialEq)]
pub(super) struct Lattice<const N: usize> {
    pub origin: [f64; N],
    pub spacing_m: f64,
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
    /// Without its coefficients, which are many.
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
        mut samples: Vec<f64>,
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
        let mut stride = 1;
        for count in counts {
            interpolate(&mut samples, stride, count);
            stride *= count;
        }
        Ok(Self { origin, spacing_m, counts, coefficients: samples })
    }

    /// First and last coordinate along an axis between which the spline is defined, m: the outermost samples are beyond.
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

/// Turns samples along one axis into coefficients whose spline is close to the samples, to fourth order in their spacing:
/// c = f − δ²f/6. Those at the ends stay.
fn interpolate(samples: &mut [f64], stride: usize, count: usize) {
    for first in 0..samples.len() {
        // Only where a line along the axis begins.
        if !(first / stride).is_multiple_of(count) {
            continue;
        }
        let mut behind = samples[first];
        for k in 1..count - 1 {
            let here = samples[first + stride * k];
            let ahead = samples[first + stride * (k + 1)];
            samples[first + stride * k] = here - (behind - 2.0 * here + ahead) / 6.0;
            behind = here;
        }
    }
}
