//! Time series of one measured or commanded value. Each series has its own times, because a bus reports motors one after the
//! other.

/// Longest gap between two measurements for an interpolation, s.
const GAP_S: f64 = 0.1;

/// Value over time, interpolated linearly between points.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Series {
    /// Points of ascending time, s, and value.
    points: Vec<[f64; 2]>,
}

impl Series {
    /// Creates a series of times and values. Skips points that are not finite, or not later than the previous one.
    pub fn new(points: impl IntoIterator<Item = (f64, f64)>) -> Self {
        let mut kept: Vec<[f64; 2]> = Vec::new();
        for (time_s, value) in points {
            let is_later = kept.last().is_none_or(|last| time_s > last[0]);
            if is_later && time_s.is_finite() && value.is_finite() {
                kept.push([time_s, value]);
            }
        }
        Self { points: kept }
    }

    /// Creates a series with a constant value.
    pub fn constant(value: f64) -> Self {
        Self { points: vec![[0.0, value]] }
    }

    /// True if the series has no points.
    pub fn is_empty(&self) -> bool {
        self.points.is_empty()
    }

    /// Points of time, s, and value.
    pub fn points(&self) -> &[[f64; 2]] {
        &self.points
    }

    /// Keeps the points of an interval of time.
    pub fn between(mut self, [from_s, to_s]: [f64; 2]) -> Self {
        self.points.retain(|point| (from_s..=to_s).contains(&point[0]));
        self
    }

    /// Mean interval between points, s; `None` for fewer than two points.
    pub fn interval_s(&self) -> Option<f64> {
        let (first, last) = (self.points.first()?, self.points.last()?);
        (self.points.len() > 1).then(|| (last[0] - first[0]) / (self.points.len() - 1) as f64)
    }

    /// Removes the jumps of values that are known up to a period, such as angles within a turn.
    pub fn unwrapped(mut self, period: f64) -> Self {
        for k in 1..self.points.len() {
            let last = self.points[k - 1][1];
            let value = &mut self.points[k][1];
            *value -= period * ((*value - last) / period).round();
        }
        self
    }

    /// Value and slope at `time_s`. Before the first and after the final point the value is constant. An empty series is 0.
    pub fn at(&self, time_s: f64) -> [f64; 2] {
        let after = self.points.partition_point(|point| point[0] < time_s);
        match (after.checked_sub(1).map(|before| self.points[before]), self.points.get(after)) {
            (Some(before), Some(after)) => {
                let slope = (after[1] - before[1]) / (after[0] - before[0]);
                [before[1] + slope * (time_s - before[0]), slope]
            }
            (Some(only), None) => [only[1], 0.0],
            (None, Some(only)) => [only[1], 0.0],
            (None, None) => [0.0; 2],
        }
    }

    /// Value at `time_s`; `None` without a measurement within `half_s`.
    ///
    /// The value is interpolated. If the points before and after the time are more than 0.1 s apart, or one is missing, the
    /// value of the nearest point is returned.
    pub fn value_near(&self, time_s: f64, half_s: f64) -> Option<f64> {
        let after = self.points.partition_point(|point| point[0] < time_s);
        let near = |point: &&[f64; 2]| (point[0] - time_s).abs() <= half_s;
        let before = after.checked_sub(1).and_then(|before| self.points.get(before));
        let next = self.points.get(after);
        let nearest =
            [before, next].into_iter().flatten().filter(near).min_by(|one, other| {
                (one[0] - time_s).abs().total_cmp(&(other[0] - time_s).abs())
            })?;
        match (before, next) {
            (Some(before), Some(next)) if next[0] - before[0] <= GAP_S => Some(self.at(time_s)[0]),
            _ => Some(nearest[1]),
        }
    }

    /// Value and slope at the beginning of an interval, from the least-squares parabola through its points.
    ///
    /// Fewer than 6 points yield the first value and slope 0. Without points in the interval the result is
    /// [`at(from_s)`](Self::at). Returns `None` for an empty series.
    pub fn beginning(&self, [from_s, to_s]: [f64; 2]) -> Option<[f64; 2]> {
        let within: Vec<&[f64; 2]> =
            self.points.iter().filter(|point| (from_s..=to_s).contains(&point[0])).collect();
        let Some(first) = within.first() else {
            return (!self.is_empty()).then(|| self.at(from_s));
        };
        if within.len() < 6 {
            return Some([first[1], 0.0]);
        }
        let rows = nalgebra::DMatrix::from_fn(within.len(), 3, |row, column| {
            (within[row][0] - from_s).powi(column as i32)
        });
        let values = nalgebra::DVector::from_fn(within.len(), |row, _| within[row][1]);
        let found = rows.svd(true, true).solve(&values, 1e-12).ok()?;
        Some([found[0], found[1]])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn it_is_linear_between_points_and_ends_with_them() {
        let series = Series::new([(0.0, 1.0), (0.1, 3.0), (0.1, 9.0), (0.2, f64::NAN), (0.3, 5.0)]);
        assert_eq!(series.points().len(), 3);
        let [value, slope] = series.at(0.05);
        assert!((value - 2.0).abs() < 1e-12 && (slope - 20.0).abs() < 1e-12);
        assert_eq!([series.at(-1.0), series.at(1.0)], [[1.0, 0.0], [5.0, 0.0]]);
        assert_eq!(series.value_near(0.05, 0.01), None);
        assert!((series.value_near(0.045, 0.05).unwrap() - 1.9).abs() < 1e-12);
        // A gap is not interpolated.
        assert_eq!(series.value_near(0.12, 0.05), Some(3.0));
    }

    #[test]
    fn angles_within_a_turn_count_turns() {
        let series = Series::new([(0.0, 3.0), (0.1, -3.0), (0.2, -1.0)]).unwrapped(6.0);
        assert_eq!(series.points(), [[0.0, 3.0], [0.1, 3.0], [0.2, 5.0]]);
    }

    #[test]
    fn a_beginning_is_that_of_the_parabola() {
        let at = |t: f64| 0.3 - 0.7 * t + 4.0 * t * t;
        let series = Series::new((0..20).map(|k| f64::from(k) * 0.01).map(|t| (t, at(t))));
        let [value, slope] = series.beginning([0.05, 0.15]).unwrap();
        assert!((value - at(0.05)).abs() < 1e-9 && (slope + 0.3).abs() < 1e-9);
        assert_eq!(Series::default().beginning([0.0, 1.0]), None);
    }
}
