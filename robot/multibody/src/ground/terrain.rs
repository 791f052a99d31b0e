//! Terrain: profiles along x (steps, ramps, stairs) and height fields. A slope is a [`super::Plane`].

use super::convex::{Flat, in_plane, parts};
use super::gaussian::blurred;
use super::spline::Lattice;
use super::{Elevation, FieldError, Ground, Surface};
use nalgebra::{Matrix2, Matrix3, Vector2, Vector3};
use std::sync::Arc;

/// Distance between two corners below which they are one point, m.
pub(super) const CORNER_MIN_M: f64 = 1e-6;

/// Polyline of heights along x, constant in y, and level before its first and after its final point.
#[derive(Clone, Debug, PartialEq)]
pub struct Profile {
    /// Coordinates x and z of the corners, m.
    corners: Vec<[f64; 2]>,
}

/// Part of a profile that is no wall.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Tread {
    /// Beginning along x, m.
    pub from_m: f64,
    /// End along x, m.
    pub to_m: f64,
    /// Point of the tread's line, x and z, m.
    pub at_m: [f64; 2],
    /// Rise per metre along x.
    pub slope: f64,
}

impl Tread {
    /// Height of the tread's line at a coordinate, m.
    pub fn height_m(&self, x_m: f64) -> f64 {
        self.at_m[1] + self.slope * (x_m - self.at_m[0])
    }
}

/// Reason for which points are not a valid profile.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum ProfileError {
    /// The list of points is empty.
    #[error("the profile is empty; give at least one point")]
    Empty,
    /// Coordinate that is not a finite number.
    #[error("point {index} is ({x_m}, {z_m}) m; expected two finite numbers")]
    Value {
        /// Index of the point.
        index: usize,
        /// Position along the profile, m.
        x_m: f64,
        /// Height, m.
        z_m: f64,
    },
    /// Overhang or duplicate point.
    #[error(
        "point {index} at x = {x_m} m does not follow the previous point: x must not decrease, and \
         points at equal x must differ in height"
    )]
    Order {
        /// Index of the point.
        index: usize,
        /// Position along the profile, m.
        x_m: f64,
    },
}

impl Profile {
    /// Creates a profile through points of x and z, m. Between two points of equal x, the ground is vertical.
    ///
    /// # Errors
    /// If there are no points, a coordinate is not finite, a point is repeated, or x decreases.
    pub fn new(corners: Vec<[f64; 2]>) -> Result<Self, ProfileError> {
        if corners.is_empty() {
            return Err(ProfileError::Empty);
        }
        for (index, &[x_m, z_m]) in corners.iter().enumerate() {
            if !(x_m.is_finite() && z_m.is_finite()) {
                return Err(ProfileError::Value { index, x_m, z_m });
            }
        }
        for (before, pair) in corners.windows(2).enumerate() {
            let [dx, dz] = [pair[1][0] - pair[0][0], pair[1][1] - pair[0][1]];
            if dx < 0.0 || dx.max(dz.abs()) < CORNER_MIN_M {
                return Err(ProfileError::Order { index: before + 1, x_m: pair[1][0] });
            }
        }
        Ok(Self { corners })
    }

    /// Creates level ground with a step. A negative height gives a step down.
    ///
    /// # Errors
    /// If a value is not finite, or the height is 0.
    pub fn step(at_x_m: f64, height_m: f64) -> Result<Self, ProfileError> {
        Self::new(vec![[at_x_m, 0.0], [at_x_m, height_m]])
    }

    /// Creates level ground with a ramp to another height.
    ///
    /// # Errors
    /// If a value is not finite, or the ramp has no length.
    pub fn ramp(from_x_m: f64, length_m: f64, height_m: f64) -> Result<Self, ProfileError> {
        Self::new(vec![[from_x_m, 0.0], [from_x_m + length_m, height_m]])
    }

    /// Coordinates of the first and the final corner, m.
    pub fn extent_m(&self) -> [f64; 2] {
        [self.corners[0][0], self.corners[self.corners.len() - 1][0]]
    }

    /// Height at a coordinate, m. At a wall, this is the height of its upper edge.
    pub fn height_m(&self, x_m: f64) -> f64 {
        let at = |corners: &[[f64; 2]]| {
            let ([x0, z0], [x1, z1]) = (corners[0], corners[1]);
            let inside = (x0..=x1).contains(&x_m);
            inside
                .then(|| if x1 > x0 { z0 + (x_m - x0) / (x1 - x0) * (z1 - z0) } else { z0.max(z1) })
        };
        let found = self.corners.windows(2).filter_map(at).reduce(f64::max);
        let end = if x_m < self.corners[0][0] { 0 } else { self.corners.len() - 1 };
        found.unwrap_or(self.corners[end][1])
    }

    /// Points x and z of the polyline within a range of x, m, its ends included.
    pub fn line(&self, [from_m, to_m]: [f64; 2]) -> Vec<[f64; 2]> {
        let inside = self.corners.iter().filter(|corner| from_m < corner[0] && corner[0] < to_m);
        let ends = [from_m, to_m].map(|x_m| [x_m, self.height_m(x_m)]);
        std::iter::once(ends[0]).chain(inside.copied()).chain([ends[1]]).collect()
    }

    /// Profile of the parts that rise or fall by less than `steep` per metre, from height 0. Steeper parts and walls are level.
    pub(super) fn ramps(&self, steep: f64) -> Self {
        let mut corners = vec![[self.corners[0][0], 0.0]];
        for pair in self.corners.windows(2) {
            let [dx, dz] = [pair[1][0] - pair[0][0], pair[1][1] - pair[0][1]];
            let rise_m = if dz.abs() < steep * dx { dz } else { 0.0 };
            corners.push([pair[1][0], corners[corners.len() - 1][1] + rise_m]);
        }
        Self { corners }
    }

    /// Parts that are not walls, in order: `[from, to]` along x, with infinity at both ends, and the line through each.
    pub fn treads(&self) -> Vec<Tread> {
        let (first, last) = (self.corners[0], self.corners[self.corners.len() - 1]);
        let level = |from_m: f64, to_m: f64, [x_m, z_m]: [f64; 2]| Tread {
            from_m,
            to_m,
            at_m: [x_m, z_m],
            slope: 0.0,
        };
        let inner = self.corners.windows(2).filter(|pair| pair[1][0] > pair[0][0]);
        let inner = inner.map(|pair| {
            let ([x0, z0], [x1, z1]) = (pair[0], pair[1]);
            Tread { from_m: x0, to_m: x1, at_m: [x0, z0], slope: (z1 - z0) / (x1 - x0) }
        });
        let all = std::iter::once(level(f64::NEG_INFINITY, first[0], first));
        let all = all.chain(inner).chain([level(last[0], f64::INFINITY, last)]);
        // Parts of one line are one tread.
        let mut treads: Vec<Tread> = Vec::new();
        for tread in all {
            match treads.last_mut() {
                Some(before)
                    if (before.slope - tread.slope).abs() < 1e-9
                        && (before.height_m(tread.from_m) - tread.height_m(tread.from_m)).abs()
                            < CORNER_MIN_M =>
                {
                    before.to_m = tread.to_m;
                }
                _ => treads.push(tread),
            }
        }
        treads
    }

    /// Returns true if a point is below the polyline. The sign of a part's distance is ambiguous near a corner that two parts
    /// share: if they meet at less than a right angle, a point in the air can be behind one of them.
    fn is_below(&self, at: &Flat) -> bool {
        let ahead = self.corners.partition_point(|corner| corner[0] <= at.x);
        let [behind, ahead] = [ahead.saturating_sub(1), ahead.min(self.corners.len() - 1)];
        let ([x0, z0], [x1, z1]) = (self.corners[behind], self.corners[ahead]);
        let share = if x1 > x0 { (at.x - x0) / (x1 - x0) } else { 0.0 };
        at.y < z0 + share * (z1 - z0)
    }
}

impl Ground for Profile {
    fn is_distance(&self) -> bool {
        true
    }

    fn parts(&self) -> Vec<Arc<dyn Ground>> {
        parts(&self.corners)
    }

    fn at(&self, point: &Vector3<f64>) -> Surface {
        let at = Flat::new(point.x, point.z);
        let first = Flat::from(self.corners[0]);
        let last = Flat::from(self.corners[self.corners.len() - 1]);
        // Start, direction and length of all parts, including the level parts on both sides.
        let ends = [(first, -Flat::x(), f64::INFINITY), (last, Flat::x(), f64::INFINITY)];
        let parts = self.corners.windows(2).map(|pair| {
            let (begin, end) = (Flat::from(pair[0]), Flat::from(pair[1]));
            (begin, (end - begin).normalize(), (end - begin).norm())
        });
        let mut nearest: Option<(f64, Surface)> = None;
        for (number, (begin, along, length)) in ends.into_iter().chain(parts).enumerate() {
            let mut up = Flat::new(-along.y, along.x);
            if number == 0 {
                up = -up;
            }
            let share = along.dot(&(at - begin));
            let corner = begin + along * share.clamp(0.0, length);
            let from = at - corner;
            let distance = from.norm();
            if nearest.is_some_and(|(least, _)| least <= distance) {
                continue;
            }
            let side = up.dot(&(at - begin));
            let beside = !(0.0..=length).contains(&share) && distance > 0.0;
            let (gap_m, normal, bend) = if beside {
                let sign = if self.is_below(&at) { -1.0 } else { 1.0 };
                let normal = from * (sign / distance);
                let free = Matrix2::identity() - normal * normal.transpose();
                (sign * distance, normal, free * (sign / distance))
            } else {
                (side, up, Matrix2::zeros())
            };
            nearest = Some((distance, in_plane(gap_m, &normal, &bend)));
        }
        nearest.expect("there are level parts").1
    }
}

/// Heights over a rectangle of the x-y plane, with a spline through them. Outside the rectangle, the height at the nearest edge
/// applies.
#[derive(Clone, Debug, PartialEq)]
pub struct HeightField {
    lattice: Lattice<2>,
}

impl HeightField {
    /// Creates a field from heights, m, at `origin_m` + `spacing_m` (i, j), with i along x varying fastest.
    ///
    /// # Errors
    /// If the spacing is not positive, an axis has fewer than four samples, the number of samples is wrong, or a sample is not
    /// finite.
    pub fn new(
        origin_m: [f64; 2],
        spacing_m: f64,
        counts: [usize; 2],
        heights_m: Vec<f64>,
    ) -> Result<Self, FieldError> {
        Ok(Self { lattice: Lattice::new(origin_m, spacing_m, counts, heights_m)? })
    }

    /// Number of heights along x and y.
    pub fn counts(&self) -> [usize; 2] {
        self.lattice.counts.map(|count| count - 2)
    }

    /// Range of x and of y with heights, m.
    pub fn extent_m(&self) -> [[f64; 2]; 2] {
        [0, 1].map(|axis| self.lattice.range(axis))
    }

    /// Field smoothed by a Gaussian with the given standard deviation, m.
    pub fn blurred(&self, deviation_m: f64) -> Self {
        let ranges = [0, 1].map(|axis| self.lattice.range(axis));
        let spacing_m = (0.25 * deviation_m).max(self.lattice.spacing_m);
        let beyond_m = 5.0 * deviation_m;
        let origin_m = ranges.map(|[first_m, _]| first_m - beyond_m);
        let counts = [0, 1].map(|axis| {
            let [first_m, last_m] = ranges[axis];
            ((last_m - first_m + 2.0 * beyond_m) / spacing_m).ceil() as usize + 2
        });
        let place = |axis: usize, k: usize| origin_m[axis] + spacing_m * k as f64;
        let row = |j: usize| {
            let at = |i: usize| self.elevation(place(0, i), place(1, j)).height_m;
            let plain: Vec<f64> = (0..counts[0]).map(at).collect();
            blurred(&plain, deviation_m / spacing_m)
        };
        let rows: Vec<Vec<f64>> = (0..counts[1]).map(row).collect();
        let mut heights_m = vec![0.0; counts[0] * counts[1]];
        for i in 0..counts[0] {
            let column: Vec<f64> = rows.iter().map(|row| row[i]).collect();
            for (j, height_m) in blurred(&column, deviation_m / spacing_m).into_iter().enumerate() {
                heights_m[j * counts[0] + i] = height_m;
            }
        }
        let lattice = Lattice::new(origin_m, spacing_m, counts, heights_m);
        Self { lattice: lattice.expect("finite heights, more than three along each axis") }
    }

    /// Height at a point of the x-y plane, with its derivatives.
    pub fn elevation(&self, x_m: f64, y_m: f64) -> Elevation {
        let at = [x_m, y_m];
        let ranges = [0, 1].map(|axis| self.lattice.range(axis));
        let within = [0, 1].map(|k| at[k].clamp(ranges[k][0], ranges[k][1]));
        // Beyond the edge, derivatives with respect to the coordinate are zero.
        let inside = [0, 1].map(|k| f64::from(u8::from(within[k] == at[k])));
        let bases = [0, 1].map(|axis| self.lattice.basis(axis, within[axis]));
        let sum = |orders| self.lattice.sum(&bases, orders);
        let [xx, yy] = [inside[0] * sum([2, 0]), inside[1] * sum([0, 2])];
        let xy = inside[0] * inside[1] * sum([1, 1]);
        Elevation {
            height_m: sum([0, 0]),
            slope: Vector2::new(inside[0] * sum([1, 0]), inside[1] * sum([0, 1])),
            bend: Matrix2::new(xx, xy, xy, yy),
        }
    }
}

impl Ground for HeightField {
    fn at(&self, point: &Vector3<f64>) -> Surface {
        let Elevation { height_m, slope, bend } = self.elevation(point.x, point.y);
        let gradient = Vector3::new(-slope.x, -slope.y, 1.0);
        let mut hessian = Matrix3::zeros();
        hessian.fixed_view_mut::<2, 2>(0, 0).copy_from(&-bend);
        Surface::of_level(point.z - height_m, &gradient, &hessian)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ground::{Plane, agrees_with_finite_differences};

    fn points(count: usize) -> impl Iterator<Item = Vector3<f64>> {
        let mut rng = fastrand::Rng::with_seed(7);
        (0..count).map(move |_| Vector3::from_fn(|_, _| 2.0 * rng.f64() - 1.0))
    }

    #[test]
    fn profiles_have_their_derivatives() {
        let stairs =
            vec![[-0.4, 0.0], [-0.4, 0.2], [0.0, 0.2], [0.0, 0.3], [0.5, 0.1], [0.5, -0.2]];
        for profile in [
            Profile::step(0.1, 0.2).unwrap(),
            Profile::step(0.1, -0.2).unwrap(),
            Profile::ramp(-0.2, 0.5, 0.3).unwrap(),
            Profile::new(stairs).unwrap(),
            Profile::new(vec![[0.0, 0.0], [0.0, 0.2], [0.3, 0.0]]).unwrap(),
        ] {
            for point in points(200) {
                agrees_with_finite_differences(&profile, &point);
            }
        }
    }

    #[test]
    fn a_step_is_a_wall_before_it_and_a_corner_above_it() {
        let step = Profile::step(1.0, 0.1).unwrap();
        let at = |x, z| step.at(&Vector3::new(x, 0.3, z));
        assert_eq!((at(0.5, 0.02).gap_m, at(0.5, 0.02).normal), (0.02, Vector3::z()));
        assert!((at(0.98, 0.05).gap_m - 0.02).abs() < 1e-15);
        assert_eq!(at(0.98, 0.05).normal, -Vector3::x());
        assert!((at(0.97, 0.14).gap_m - 0.05).abs() < 1e-15);
        assert!((at(0.97, 0.14).normal - Vector3::new(-0.6, 0.0, 0.8)).norm() < 1e-12);
        assert!((at(1.5, 0.04).gap_m + 0.06).abs() < 1e-15, "inside");
        assert!((at(1.02, 0.05).gap_m + 0.02).abs() < 1e-15, "inside, near the wall");
    }

    /// Tests that the nearest of all parts equals the profile, from above and slightly below.
    #[test]
    fn parts_make_up_their_profile() {
        let teeth =
            vec![[-0.5, 0.0], [-0.2, 0.6], [-0.2, -0.4], [0.0, 0.1], [0.0, -0.3], [0.3, 0.5]];
        let block = vec![[-0.2, 0.0], [-0.2, 0.3], [0.1, 0.3], [0.1, 0.0]];
        let deep = vec![[0.0, 0.0], [0.0, 0.2], [0.1, 0.2], [0.5, -2.0]];
        for (corners, count) in [
            (vec![[0.1, 0.0], [0.1, 0.2]], 2),
            (vec![[0.1, 0.0], [0.1, -0.2]], 2),
            (vec![[0.0, 0.0], [0.5, 0.2]], 2),
            (vec![[0.0, 0.0]], 1),
            (block, 3),
            (deep, 3),
            (teeth, 4),
        ] {
            let profile = Profile::new(corners).unwrap();
            let parts = profile.parts();
            assert_eq!(parts.len(), count, "{profile:?}");
            for point in points(3000) {
                let whole = profile.at(&point);
                let seen = parts.iter().map(|part| part.at(&point));
                let nearest = seen.min_by(|a, b| a.gap_m.total_cmp(&b.gap_m)).unwrap();
                assert_eq!(whole.gap_m > 0.0, nearest.gap_m > 0.0, "{point:?} {profile:?}");
                if whole.gap_m > -1e-3 {
                    assert!((whole.gap_m - nearest.gap_m).abs() < 1e-12, "{point:?} {profile:?}");
                }
            }
            for point in points(200) {
                parts.iter().for_each(|part| agrees_with_finite_differences(part.as_ref(), &point));
            }
        }
    }

    /// Tests stairs whose solid has acute corners, up and down.
    #[test]
    fn the_gap_is_negative_below_the_profile_and_nowhere_else() {
        let stairs =
            vec![[-0.4, 0.0], [-0.4, 0.2], [0.0, 0.2], [0.0, 0.3], [0.5, 0.1], [0.5, -0.2]];
        let teeth =
            vec![[-0.5, 0.0], [-0.2, 0.6], [-0.2, -0.4], [0.0, 0.1], [0.0, -0.3], [0.3, 0.5]];
        for corners in [stairs, teeth, vec![[0.0, 0.0], [0.0, 0.2], [0.3, 0.0]]] {
            let profile = Profile::new(corners.clone()).unwrap();
            for point in points(5000) {
                let above = |pair: &[[f64; 2]]| {
                    let ([x0, z0], [x1, z1]) = (pair[0], pair[1]);
                    (x0 <= point.x && point.x < x1)
                        .then(|| (point.z - z0) * (x1 - x0) > (point.x - x0) * (z1 - z0))
                };
                let end = if point.x < corners[0][0] { 0 } else { corners.len() - 1 };
                let above = corners.windows(2).find_map(above).unwrap_or(point.z > corners[end][1]);
                let gap_m = profile.at(&point).gap_m;
                assert_eq!(gap_m > 0.0, above, "{gap_m} m at {point:?} of {corners:?}");
            }
        }
        let tooth = Profile::new(vec![[0.0, 0.0], [0.0, 0.2], [0.3, 0.0]]).unwrap();
        let gap_m = tooth.at(&Vector3::new(0.05, 0.0, 0.3)).gap_m;
        assert!((gap_m - 0.05_f64.hypot(0.1)).abs() < 1e-15, "{gap_m}");
    }

    #[test]
    fn a_ramp_is_a_slope_in_its_middle() {
        let (ramp, slope) = (Profile::ramp(-1.0, 2.0, 0.5), Plane::rising(0.25_f64.atan()));
        let ramp = ramp.unwrap();
        for point in points(50).map(|point| point * 0.2) {
            let (found, exact) = (ramp.at(&point), slope.at(&(point - Vector3::z() * 0.25)));
            assert!((found.gap_m - exact.gap_m).abs() < 1e-12);
            assert!((found.normal - exact.normal).norm() < 1e-12);
        }
    }

    #[test]
    fn points_that_make_no_profile_are_refused() {
        assert_eq!(Profile::new(vec![]).unwrap_err(), ProfileError::Empty);
        let back = Profile::new(vec![[0.0, 0.0], [1.0, 0.0], [0.5, 0.1]]).unwrap_err();
        assert_eq!(back, ProfileError::Order { index: 2, x_m: 0.5 });
        assert!(Profile::step(0.0, f64::NAN).is_err());
        assert!(Profile::step(0.0, 0.0).is_err());
        assert!(Profile::ramp(0.0, -1.0, 0.1).is_err());
    }

    fn field(height: impl Fn(f64, f64) -> f64) -> HeightField {
        let place = |k: usize| -1.2 + 0.1 * k as f64;
        let heights = (0..25).flat_map(|j| (0..25).map(move |i| [place(i), place(j)]));
        let heights = heights.map(|[x, y]| height(x, y)).collect();
        HeightField::new([-1.2, -1.2], 0.1, [25, 25], heights).unwrap()
    }

    #[test]
    fn height_fields_have_their_derivatives_and_are_planes_where_their_heights_are() {
        let bumps = field(|x, y| 0.05 * (3.0 * x).sin() * (4.0 * y).cos());
        for point in points(200) {
            let low = Vector3::new(point.x, point.y, 0.1 * point.z);
            agrees_with_finite_differences(&bumps, &low);
        }
        let (plane, slope) = (field(|x, _| 0.25 * x), Plane::rising(0.25_f64.atan()));
        for point in points(50) {
            let (found, exact) = (plane.at(&point), slope.at(&point));
            assert!((found.gap_m - exact.gap_m).abs() < 1e-12);
            assert!((found.normal - exact.normal).norm() < 1e-12);
            assert!(found.curvature.norm() < 1e-10);
        }
        let mut rng = fastrand::Rng::with_seed(4);
        let heights: Vec<_> = (0..35).map(|_| rng.f64()).collect();
        let random = HeightField::new([1.0, 2.0], 0.5, [5, 7], heights.clone()).unwrap();
        for (number, height) in heights.into_iter().enumerate() {
            let at = [number % 5, number / 5].map(|k| 0.5 * k as f64);
            let top = random.at(&Vector3::new(1.0 + at[0], 2.0 + at[1], height));
            assert!(top.gap_m.abs() < 1e-12, "sample {number}: {}", top.gap_m);
        }
        let corner = random.at(&Vector3::new(3.1, 5.1, 2.0));
        let far = random.at(&Vector3::new(9.0, 9.0, 2.0));
        assert!((corner.gap_m - far.gap_m).abs() < 1e-12, "it goes on as at its edge");
        let beyond = bumps.at(&Vector3::new(3.0, -5.0, 1.0));
        assert_eq!(beyond.normal, Vector3::z());
    }
}
