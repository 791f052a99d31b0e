//! Solid of any shape, as distances on a grid (thesis 4.5.3).

use super::spline::Lattice;
use super::{FieldError, Ground, Surface};
use nalgebra::{Matrix3, Vector3};

/// Signed distances at the points of a grid, with a spline through them. The space outside the grid is empty.
#[derive(Clone, Debug, PartialEq)]
pub struct Grid {
    lattice: Lattice<3>,
}

impl Grid {
    /// Creates a solid from signed distances, m, at `origin` + `spacing_m` (i, j, k), with i varying fastest.
    ///
    /// # Errors
    /// If the spacing is not positive, an axis has fewer than four samples, the number of samples is wrong, a sample is not
    /// finite, or a sample in the two outermost layers is not positive.
    pub fn new(
        origin: Vector3<f64>,
        spacing_m: f64,
        counts: [usize; 3],
        distances_m: Vec<f64>,
    ) -> Result<Self, FieldError> {
        for (index, &value) in distances_m.iter().enumerate() {
            let mut rest = index;
            let outermost = counts.iter().any(|&count| {
                let k = rest % count.max(1);
                rest /= count.max(1);
                k < 2 || k + 2 >= count
            });
            if outermost && value <= 0.0 {
                return Err(FieldError::Cut { index, value });
            }
        }
        Ok(Self { lattice: Lattice::new(origin.into(), spacing_m, counts, distances_m)? })
    }

    /// Samples another ground on a grid that starts at `origin`.
    ///
    /// # Errors
    /// Returns the errors of [`Grid::new`].
    pub fn of(
        ground: &dyn Ground,
        origin: Vector3<f64>,
        spacing_m: f64,
        counts: [usize; 3],
    ) -> Result<Self, FieldError> {
        let [across, along, up] = counts.map(|count| 0..count);
        let places = up.flat_map(|k| {
            let across = across.clone();
            along.clone().flat_map(move |j| across.clone().map(move |i| [i, j, k]))
        });
        let distance = |place: [usize; 3]| {
            let steps = Vector3::from(place.map(|k| k as f64));
            ground.at(&(origin + steps * spacing_m)).gap_m
        };
        Self::new(origin, spacing_m, counts, places.map(distance).collect())
    }
}

impl Grid {
    /// Evaluates the solid at a point within the lattice.
    fn within(&self, point: &Vector3<f64>) -> Surface {
        let bases = [0, 1, 2].map(|axis| self.lattice.basis(axis, point[axis]));
        let sum = |orders| self.lattice.sum(&bases, orders);
        let gradient = Vector3::new(sum([1, 0, 0]), sum([0, 1, 0]), sum([0, 0, 1]));
        let [xy, xz, yz] = [sum([1, 1, 0]), sum([1, 0, 1]), sum([0, 1, 1])];
        let [xx, yy, zz] = [sum([2, 0, 0]), sum([0, 2, 0]), sum([0, 0, 2])];
        let hessian = Matrix3::new(xx, xy, xz, xy, yy, yz, xz, yz, zz);
        Surface::of_level(sum([0, 0, 0]), &gradient, &hessian)
    }
}

impl Ground for Grid {
    fn at(&self, point: &Vector3<f64>) -> Surface {
        let ranges = [0, 1, 2].map(|axis| self.lattice.range(axis));
        let within = Vector3::from([0, 1, 2].map(|k| point[k].clamp(ranges[k][0], ranges[k][1])));
        let surface = self.within(&within);
        let beyond = point - within;
        if beyond == Vector3::zeros() {
            return surface;
        }
        // Distance from the solid's point that is nearest to the end of the lattice, so that gap and normal are continuous
        // across its boundary.
        let Surface { gap_m, gradient, normal, curvature } = surface;
        let from_solid = beyond + normal * gap_m;
        let gap_m = from_solid.norm().max(f64::MIN_POSITIVE);
        let inside = Matrix3::from_diagonal(&beyond.map(|part| f64::from(u8::from(part == 0.0))));
        let moves = curvature * surface.gap_m + normal * gradient.transpose();
        let by_point = Matrix3::identity() - inside + moves * inside;
        let normal = from_solid / gap_m;
        Surface {
            gap_m,
            gradient: by_point.transpose() * normal,
            normal,
            curvature: (by_point - normal * (normal.transpose() * by_point)) / gap_m,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ground::{Sphere, agrees_with_finite_differences};

    const BALL: Sphere = Sphere { center: Vector3::new(0.013, -0.007, 0.02), radius_m: 0.1 };

    fn grid(cells: usize) -> Grid {
        let spacing_m = 0.3 / cells as f64;
        Grid::of(&BALL, Vector3::repeat(-0.15), spacing_m, [cells + 1; 3]).unwrap()
    }

    fn directions() -> impl Iterator<Item = Vector3<f64>> {
        let mut rng = fastrand::Rng::with_seed(5);
        (0..100).map(move |_| Vector3::from_fn(|_, _| rng.f64() - 0.5).normalize())
    }

    #[test]
    fn gradient_and_curvature_agree_with_finite_differences() {
        for direction in directions() {
            for depth in [-0.02, 0.0, 0.01] {
                let point = BALL.center + direction * (BALL.radius_m + depth);
                agrees_with_finite_differences(&grid(24), &point);
            }
        }
    }

    /// Tests the largest errors of gap, normal and curvature at the surface of a ball, on successively finer grids.
    #[test]
    fn a_grid_becomes_the_solid_that_it_samples() {
        let errors = |cells| {
            let grid = grid(cells);
            let mut worst = [0.0_f64; 3];
            for direction in directions() {
                let point = BALL.center + direction * (BALL.radius_m - 0.001);
                let (found, exact) = (grid.at(&point), BALL.at(&point));
                let all = [
                    (found.gap_m - exact.gap_m).abs(),
                    (found.normal - exact.normal).norm(),
                    (found.curvature - exact.curvature).norm(),
                ];
                worst = std::array::from_fn(|k| worst[k].max(all[k]));
            }
            worst
        };
        let (coarse, fine) = (errors(24), errors(48));
        for (k, least) in [1.9, 1.9, 0.9].into_iter().enumerate() {
            let order = (coarse[k] / fine[k]).log2();
            assert!(order > least, "{k}: order {order}, errors {} and {}", coarse[k], fine[k]);
        }
        // 0.1 % of the radius with cells of a sixteenth.
        assert!(fine[0] < 1e-4, "{}", fine[0]);
    }

    /// Tests that the field is smooth far outside and at the boundary of the lattice, 1 µm on either side along rays from the
    /// middle.
    #[test]
    fn gap_and_normal_go_on_across_the_boundary_of_the_lattice() {
        let grid = grid(24);
        let ends = grid.lattice.range(0);
        let (middle, half_m) =
            (Vector3::repeat(0.5 * (ends[0] + ends[1])), 0.5 * (ends[1] - ends[0]));
        for direction in directions() {
            let to_boundary = direction * (half_m / direction.amax());
            let [inside, outside] =
                [-1e-6, 1e-6].map(|by| grid.at(&(middle + to_boundary + direction * by)));
            assert!((outside.gap_m - inside.gap_m).abs() < 1e-5, "{inside:?}, {outside:?}");
            assert!((outside.normal - inside.normal).norm() < 1e-4, "{inside:?}, {outside:?}");
            for share in [1.1, 2.0] {
                let point = middle + to_boundary * share;
                agrees_with_finite_differences(&grid, &point);
                let (found, exact) = (grid.at(&point), BALL.at(&point));
                assert!(found.gap_m > 0.95 * exact.gap_m && found.gap_m < 1.2 * exact.gap_m);
            }
        }
    }

    #[test]
    fn samples_that_make_no_solid_are_refused() {
        let new =
            |counts, count| Grid::new(Vector3::zeros(), 0.1, counts, vec![1.0; count]).unwrap_err();
        assert_eq!(new([3, 4, 4], 48), FieldError::Few { axis: 0, count: 3 });
        assert_eq!(new([4, 4, 4], 63), FieldError::Length { found: 63, wanted: 64 });
        let mut samples = vec![1.0; 64];
        samples[5] = f64::NAN;
        let none = Grid::new(Vector3::zeros(), 0.1, [4; 3], samples).unwrap_err();
        assert!(none.to_string().starts_with("sample 5 is NaN"), "{none}");
        let cut = Grid::of(&BALL, Vector3::repeat(-0.05), 0.01, [11; 3]).unwrap_err();
        assert!(matches!(cut, FieldError::Cut { .. }), "{cut}");
    }
}
