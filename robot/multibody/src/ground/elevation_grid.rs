//! Elevation map as a sensor delivers it: heights at the cells of a grid, some of them unknown, and filters over the grid.
//!
//! Walls are steps between neighbouring cells. A spline through the heights would overshoot there, so that the equations of
//! the planner use filtered grids: denoised for footholds, dilated for swings, closed by a ball for wheels.

use super::gaussian::{CUT_OFF, blurred};
use super::spline::LEAST;
use super::{FieldError, HeightField};
use nalgebra::Vector2;

/// Heights on a grid, m. Unknown heights are NaN or infinite.
#[derive(Clone, Debug, PartialEq)]
pub struct ElevationGrid {
    /// Position of the first cell, m.
    pub origin_m: [f64; 2],
    /// Distance between cells, m.
    pub spacing_m: f64,
    /// Number of cells along x and y.
    pub counts: [usize; 2],
    /// Heights, with x varying fastest, m.
    pub heights_m: Vec<f64>,
}

impl ElevationGrid {
    /// Samples heights at the cells of a square around a point.
    pub fn around(
        center_m: Vector2<f64>,
        half_m: f64,
        spacing_m: f64,
        mut height_m: impl FnMut(Vector2<f64>) -> f64,
    ) -> Self {
        let half = (half_m / spacing_m).ceil();
        // Cells are at multiples of the spacing, so that grids around neighbouring points agree.
        let first = center_m.map(|at| ((at / spacing_m).round() - half) * spacing_m);
        let count = 2 * half as usize + 1;
        let cells = (0..count).flat_map(|j| (0..count).map(move |i| [i, j]));
        let heights_m = cells
            .map(|cell| height_m(first + Vector2::from(cell.map(|k| k as f64)) * spacing_m))
            .collect();
        Self { origin_m: first.into(), spacing_m, counts: [count; 2], heights_m }
    }

    /// Position of a cell, m.
    pub fn place_m(&self, [i, j]: [usize; 2]) -> Vector2<f64> {
        Vector2::from(self.origin_m) + Vector2::new(i as f64, j as f64) * self.spacing_m
    }

    /// Height at a cell, m.
    pub fn height_m(&self, [i, j]: [usize; 2]) -> f64 {
        self.heights_m[j * self.counts[0] + i]
    }

    /// Cell that is nearest to a point.
    pub fn nearest(&self, point: &Vector2<f64>) -> [usize; 2] {
        [0, 1].map(|k| {
            let at = ((point[k] - self.origin_m[k]) / self.spacing_m).round().max(0.0) as usize;
            at.min(self.counts[k] - 1)
        })
    }

    /// Cells.
    pub fn cells(&self) -> impl Iterator<Item = [usize; 2]> + use<> {
        let [columns, rows] = self.counts;
        (0..rows).flat_map(move |j| (0..columns).map(move |i| [i, j]))
    }

    /// Offsets of the cells within a distance of a cell, in cells.
    fn disc(&self, radius_m: f64) -> Vec<[isize; 2]> {
        let reach = (radius_m / self.spacing_m).floor() as isize;
        let within = |i: isize, j: isize| {
            ((i * i + j * j) as f64).sqrt() * self.spacing_m <= radius_m + 1e-9
        };
        let all = (-reach..=reach).flat_map(|j| (-reach..=reach).map(move |i| [i, j]));
        all.filter(|[i, j]| within(*i, *j)).collect()
    }

    /// Cell at an offset; `None` outside the grid.
    fn beside(&self, [i, j]: [usize; 2], [di, dj]: [isize; 2]) -> Option<[usize; 2]> {
        let at = [i.checked_add_signed(di)?, j.checked_add_signed(dj)?];
        (at[0] < self.counts[0] && at[1] < self.counts[1]).then_some(at)
    }

    /// Cells within a distance of a cell that are inside the grid.
    pub fn around_cell(&self, cell: [usize; 2], radius_m: f64) -> Vec<[usize; 2]> {
        self.disc(radius_m).into_iter().filter_map(|by| self.beside(cell, by)).collect()
    }

    fn with(&self, heights_m: Vec<f64>) -> Self {
        Self { heights_m, ..self.clone() }
    }

    /// Applies a function to the offsets and heights around each cell.
    fn filtered(
        &self,
        radius_m: f64,
        of: impl Fn(&mut dyn Iterator<Item = ([isize; 2], f64)>) -> f64,
    ) -> Self {
        let disc = self.disc(radius_m);
        let at = |cell: [usize; 2]| {
            let height = |by: &[isize; 2]| Some((*by, self.height_m(self.beside(cell, *by)?)));
            of(&mut disc.iter().filter_map(height))
        };
        self.with(self.cells().map(at).collect())
    }

    /// Returns an error unless the grid has a finite origin, a positive spacing, four cells or more along each axis, and one
    /// height for each cell.
    fn check(&self) -> Result<(), FieldError> {
        let Self { origin_m, spacing_m, counts, heights_m } = self;
        let (origin_m, spacing_m, found) = (*origin_m, *spacing_m, heights_m.len());
        if !origin_m.iter().all(|at| at.is_finite()) {
            return Err(FieldError::Origin { origin_m });
        }
        if !(spacing_m > 0.0 && spacing_m.is_finite()) {
            return Err(FieldError::Spacing { spacing_m });
        }
        if let Some((axis, &count)) = counts.iter().enumerate().find(|(_, count)| **count < LEAST) {
            return Err(FieldError::Few { axis, count });
        }
        let wanted = counts[0].saturating_mul(counts[1]);
        if found == wanted { Ok(()) } else { Err(FieldError::Length { found, wanted }) }
    }

    /// Fills unknown heights with the lowest known neighbour, cell by cell from the rims of each hole. The lowest is used because
    /// a sensor does not see the lower side behind an edge.
    ///
    /// # Errors
    /// Returns an error if the grid is not valid, or if no height is known.
    pub fn filled(&self) -> Result<Self, FieldError> {
        self.check()?;
        let known = |height: &f64| if height.is_finite() { *height } else { f64::NAN };
        let mut heights_m: Vec<f64> = self.heights_m.iter().map(known).collect();
        if heights_m.iter().all(|height| height.is_nan()) {
            return Err(FieldError::Unknown);
        }
        let beside = [[-1, 0], [1, 0], [0, -1], [0, 1]];
        while heights_m.iter().any(|height| height.is_nan()) {
            let grid = self.with(heights_m.clone());
            for (height, cell) in heights_m.iter_mut().zip(self.cells()) {
                if height.is_nan() {
                    let near = beside.iter().filter_map(|by| grid.beside(cell, *by));
                    // `f64::min` ignores NaN.
                    *height = near.map(|cell| grid.height_m(cell)).fold(f64::NAN, f64::min);
                }
            }
        }
        Ok(self.with(heights_m))
    }

    /// Median over a disc. It removes noise and keeps walls.
    pub fn median(&self, radius_m: f64) -> Self {
        self.filtered(radius_m, |near| {
            let mut heights: Vec<f64> = near.map(|(_, height)| height).collect();
            let middle = heights.len() / 2;
            *heights.select_nth_unstable_by(middle, f64::total_cmp).1
        })
    }

    /// Maximum over a disc.
    pub fn highest(&self, radius_m: f64) -> Self {
        self.filtered(radius_m, |near| near.fold(f64::NEG_INFINITY, |most, (_, at)| most.max(at)))
    }

    /// Closing by a ball: the surface that a rolling ball of this radius can touch.
    pub fn rolled(&self, radius_m: f64) -> Self {
        let cap = |[i, j]: [isize; 2]| {
            let square = (i * i + j * j) as f64 * self.spacing_m * self.spacing_m;
            (radius_m * radius_m - square).max(0.0).sqrt()
        };
        let centers = self.filtered(radius_m, |near| {
            near.fold(f64::NEG_INFINITY, |most, (by, at)| most.max(at + cap(by)))
        });
        centers.filtered(radius_m, |near| {
            near.fold(f64::INFINITY, |least, (by, at)| least.min(at - cap(by)))
        })
    }

    /// Grid smoothed by a Gaussian with this standard deviation, m.
    pub fn blurred(&self, deviation_m: f64) -> Self {
        let deviation = deviation_m / self.spacing_m;
        if deviation * CUT_OFF < 1.0 {
            return self.clone();
        }
        let [columns, rows] = self.counts;
        let mut heights_m: Vec<f64> =
            self.heights_m.chunks(columns).flat_map(|row| blurred(row, deviation)).collect();
        for i in 0..columns {
            let column: Vec<f64> = (0..rows).map(|j| heights_m[j * columns + i]).collect();
            for (j, height_m) in blurred(&column, deviation).into_iter().enumerate() {
                heights_m[j * columns + i] = height_m;
            }
        }
        self.with(heights_m)
    }

    /// Spline through the heights.
    ///
    /// # Errors
    /// Returns an error if an axis has fewer than four cells, or if a height is unknown.
    pub fn field(&self) -> Result<HeightField, FieldError> {
        HeightField::new(self.origin_m, self.spacing_m, self.counts, self.heights_m.clone())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Kerb of 40 mm at x = 0.2 m.
    fn kerb() -> ElevationGrid {
        ElevationGrid::around(
            Vector2::zeros(),
            0.5,
            0.02,
            |at| {
                if at.x > 0.19 { 0.04 } else { 0.0 }
            },
        )
    }

    #[test]
    fn cells_are_at_multiples_of_the_spacing() {
        let grid = ElevationGrid::around(Vector2::new(0.313, -0.207), 0.1, 0.02, |at| at.x);
        assert_eq!(grid.counts, [11, 11]);
        for cell in grid.cells() {
            let place = grid.place_m(cell);
            assert!((grid.height_m(cell) - place.x).abs() < 1e-12);
            assert!(((place.x / 0.02).round() * 0.02 - place.x).abs() < 1e-12);
            assert_eq!(grid.nearest(&(place + Vector2::new(0.009, -0.009))), cell);
        }
        assert_eq!(grid.nearest(&Vector2::new(9.0, -9.0)), [10, 0]);
    }

    #[test]
    fn holes_take_the_lower_side_and_noise_is_removed_without_moving_the_wall() {
        let mut rng = fastrand::Rng::with_seed(3);
        let mut grid = kerb();
        for height in &mut grid.heights_m {
            *height += 0.005 * (rng.f64() - 0.5);
            if rng.f64() < 0.2 {
                *height = f64::NAN;
            }
        }
        let filled = grid.filled().unwrap();
        assert!(filled.heights_m.iter().all(|height| height.is_finite()));
        let smooth = filled.median(0.03);
        for cell in smooth.cells() {
            let wall_m = (smooth.place_m(cell).x - 0.19).abs();
            let expected = kerb().height_m(cell);
            let off = (smooth.height_m(cell) - expected).abs();
            assert!(wall_m < 0.03 || off < 0.0025, "{:?}: {off}", smooth.place_m(cell));
        }
    }

    #[test]
    fn infinite_heights_are_unknown() {
        let mut grid = kerb();
        for (k, height) in grid.heights_m.iter_mut().enumerate().filter(|(k, _)| k % 7 == 0) {
            *height = [f64::INFINITY, f64::NEG_INFINITY, f64::NAN][k % 3];
        }
        let filled = grid.filled().unwrap();
        assert!(filled.heights_m.iter().all(|height| [0.0, 0.04].contains(height)));
    }

    #[test]
    fn invalid_and_unknown_grids_are_refused() {
        let grid = kerb();
        let count = grid.heights_m.len();
        let unknown = grid.with(vec![f64::INFINITY; count]).filled();
        assert_eq!(unknown, Err(FieldError::Unknown));
        let short = grid.with(vec![0.0; count - 1]).filled();
        assert_eq!(short, Err(FieldError::Length { found: count - 1, wanted: count }));
        let overflowing = ElevationGrid { counts: [usize::MAX; 2], ..grid.clone() }.filled();
        assert!(matches!(overflowing, Err(FieldError::Length { .. })), "{overflowing:?}");
        let narrow = ElevationGrid { counts: [3, count], ..grid.clone() }.filled();
        assert_eq!(narrow, Err(FieldError::Few { axis: 0, count: 3 }));
        let dense = ElevationGrid { spacing_m: 0.0, ..grid.clone() }.filled();
        assert_eq!(dense, Err(FieldError::Spacing { spacing_m: 0.0 }));
        let origin_m = [0.0, f64::INFINITY];
        let nowhere = ElevationGrid { origin_m, ..grid }.filled();
        assert_eq!(nowhere, Err(FieldError::Origin { origin_m }));
    }

    #[test]
    fn dilation_moves_the_wall_and_a_ball_touches_the_kerb_before_it() {
        let grid = kerb();
        let at = |grid: &ElevationGrid, x: f64| {
            // To the micrometre.
            (1e6 * grid.height_m(grid.nearest(&Vector2::new(x, 0.0)))).round() * 1e-6
        };
        let highest = grid.highest(0.04);
        assert_eq!((at(&highest, 0.12), at(&highest, 0.16)), (0.0, 0.04));
        // A ball of 95 mm touches floor and edge: 76 mm before the edge it leaves the floor (2 r k − k²).
        let rolled = grid.rolled(0.095);
        assert_eq!((at(&rolled, 0.1), at(&rolled, 0.22)), (0.0, 0.04));
        let between = at(&rolled, 0.18);
        assert!(0.01 < between && between < 0.04, "{between}");
        let blurred = grid.blurred(0.02);
        assert!((at(&blurred, 0.19) - 0.02).abs() < 0.01);
        assert!(blurred.field().is_ok());
    }
}
