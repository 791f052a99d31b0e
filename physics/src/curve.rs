//! Curves of time through knots. Targets of motors are optimised as such curves, because they are smooth and have few
//! parameters.
//!
//! Terrain uses the same cubic B-splines, with coefficients that interpolate its samples.

/// Interpolation of a curve between its knots.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Degree {
    /// Straight lines between the knots; the rate jumps at knots.
    Linear,
    /// Uniform cubic B-spline with continuous second derivative. The curve passes near its knots, not through them.
    Cubic,
}

/// Curve with equally spaced knots in time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Curve {
    /// Time of the first knot, s.
    pub begin_s: f64,
    /// Time between knots, s.
    pub spacing_s: f64,
    /// Number of knots.
    pub knots: usize,
    /// Interpolation between the knots.
    pub degree: Degree,
    /// True for a cycle, in which the first knot follows the final one. Otherwise the curve is constant before the first knot
    /// and after the final one.
    pub periodic: bool,
}

impl Curve {
    /// Value and rate at `time_s` for given values of the knots.
    pub fn at(&self, values: &[f64], time_s: f64) -> [f64; 2] {
        let mut sum = [0.0; 2];
        for (knot, weights) in self.weights(time_s) {
            sum[0] += values[knot] * weights[0];
            sum[1] += values[knot] * weights[1];
        }
        sum
    }

    /// Derivatives of value and rate at `time_s` with respect to one knot.
    pub fn of_knot(&self, knot: usize, time_s: f64) -> [f64; 2] {
        let mut sum = [0.0; 2];
        for (_, weights) in self.weights(time_s).into_iter().filter(|(of, _)| *of == knot) {
            sum[0] += weights[0];
            sum[1] += weights[1];
        }
        sum
    }

    /// Indices of the contributing knots, and their weights in value and rate.
    fn weights(&self, time_s: f64) -> [(usize, [f64; 2]); 4] {
        let mut place = (time_s - self.begin_s) / self.spacing_s;
        let mut pace = 1.0 / self.spacing_s;
        let count = self.knots as f64;
        if self.periodic {
            place = place.rem_euclid(count);
        } else if !(0.0..=count - 1.0).contains(&place) {
            (place, pace) = (place.clamp(0.0, count - 1.0), 0.0);
        }
        let before = place.floor();
        let t = place - before;
        let u = 1.0 - t;
        let values = match self.degree {
            Degree::Linear => [[0.0, 0.0], [u, -1.0], [t, 1.0], [0.0, 0.0]],
            Degree::Cubic => [
                [u * u * u / 6.0, -0.5 * u * u],
                [2.0 / 3.0 - t * t + 0.5 * t * t * t, -2.0 * t + 1.5 * t * t],
                [2.0 / 3.0 - u * u + 0.5 * u * u * u, 2.0 * u - 1.5 * u * u],
                [t * t * t / 6.0, 0.5 * t * t],
            ],
        };
        [0, 1, 2, 3].map(|k| {
            let number = before as i64 + k as i64 - 1;
            let last = self.knots as i64 - 1;
            let knot = match self.periodic {
                true => number.rem_euclid(last + 1),
                false => number.clamp(0, last),
            };
            (knot as usize, [values[k][0], values[k][1] * pace])
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn weights_sum_to_one_and_rates_are_derivatives() {
        let values = [0.3, -0.2, 0.5, 0.1, 0.4];
        for (degree, periodic) in
            [Degree::Linear, Degree::Cubic].into_iter().flat_map(|d| [(d, false), (d, true)])
        {
            let curve = Curve { begin_s: 0.2, spacing_s: 0.1, knots: 5, degree, periodic };
            for k in 0..90 {
                let time_s = 0.007 + 0.0101 * f64::from(k);
                let [one, still] = curve.at(&[1.0; 5], time_s);
                assert!((one - 1.0).abs() < 1e-12 && still.abs() < 1e-12, "{curve:?} {time_s}");
                let [_, rate] = curve.at(&values, time_s);
                let step = 1e-6;
                let difference =
                    curve.at(&values, time_s + step)[0] - curve.at(&values, time_s - step)[0];
                assert!((difference / (2.0 * step) - rate).abs() < 1e-7, "{curve:?} {time_s}");
                let of_knots: f64 =
                    (0..5).map(|knot| values[knot] * curve.of_knot(knot, time_s)[0]).sum();
                assert!((of_knots - curve.at(&values, time_s)[0]).abs() < 1e-12);
            }
        }
        let curve = Curve {
            begin_s: 0.2,
            spacing_s: 0.1,
            knots: 5,
            degree: Degree::Linear,
            periodic: true,
        };
        assert!((curve.at(&values, 0.4)[0] - 0.5).abs() < 1e-12);
        assert!((curve.at(&values, 0.95)[0] - curve.at(&values, 0.45)[0]).abs() < 1e-12);
    }
}
