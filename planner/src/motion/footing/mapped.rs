//! Ground of a sensed elevation map.
//!
//! A median removes noise and keeps walls. The result is filtered like the profiles of terrain files: smoothed for feet, dilated
//! for swings, closed by a ball for wheels, blurred for the body. Feet stand on steppable cells, which are far from edges and
//! walls.

use super::margins::{ContactMargins, DISC, WHEEL_DEVIATION, body_deviation_m, swing_deviation_m};
use super::patch::{Border, Patch};
use nalgebra::Vector2;
use rollwalk_multibody::ground::{ElevationGrid, ElevationMap, FieldError, HeightField};
use rollwalk_robot::Robot;
use std::sync::Arc;

/// Largest deviation of the heights around a steppable cell from a plane, as a fraction of the margin.
const UNEVENNESS: f64 = 0.15;
/// Largest slope of a steppable cell, as a tangent: 30°.
const SLOPE_MAX: f64 = 0.58;
/// Distance within which a foothold moves to a steppable cell, m.
const SEARCH_M: f64 = 0.3;
/// Number of cells by which a patch may extend from its first cell in each direction.
const PATCH_CELLS: usize = 15;

/// Cells of an elevation map on which an end effector can stand.
#[derive(Clone, Debug)]
pub(super) struct Steppable {
    /// Smoothed heights.
    pub map: ElevationMap,
    grid: ElevationGrid,
    flags: Vec<bool>,
}

impl Steppable {
    /// Evaluates the cells of a denoised grid. A cell is steppable only if the envelope of swings is down to the ground there.
    fn new(
        field: &Arc<HeightField>,
        grid: &ElevationGrid,
        envelope: &ElevationGrid,
        margin_m: f64,
        reach_m: f64,
    ) -> Self {
        let is_steppable = |cell: [usize; 2]| {
            let (slope, uneven_m) = plane_fit(grid, cell, margin_m)?;
            let above_m = envelope.height_m(cell) - grid.height_m(cell) - slope * reach_m;
            let even = uneven_m.max(above_m) <= UNEVENNESS * margin_m;
            Some(even && slope <= SLOPE_MAX)
        };
        let flags = grid.cells().map(|cell| is_steppable(cell).unwrap_or(false)).collect();
        Self { map: ElevationMap::Field(Arc::clone(field)), grid: grid.clone(), flags }
    }

    fn is_steppable(&self, [i, j]: [usize; 2]) -> bool {
        self.flags[j * self.grid.counts[0] + i]
    }

    /// Rectangle of steppable cells near a point; `None` if there is none.
    pub fn patch(&self, near: &Vector2<f64>) -> Option<Patch> {
        let grid = &self.grid;
        let off = |cell: &[usize; 2]| (grid.place_m(*cell) - near).norm_squared();
        let cells = grid.around_cell(grid.nearest(near), SEARCH_M).into_iter();
        let cells = cells.filter(|cell| self.is_steppable(*cell));
        let first = cells.min_by(|a, b| off(a).total_cmp(&off(b)))?;
        let [mut low, mut high] = [first, first];
        let all = |low: [usize; 2], high: [usize; 2]| {
            (low[1]..=high[1]).all(|j| (low[0]..=high[0]).all(|i| self.is_steppable([i, j])))
        };
        let mut grows = [true; 4];
        for _ in 0..PATCH_CELLS {
            for (side, grows) in grows.iter_mut().enumerate().filter(|(_, grows)| **grows) {
                let (axis, up) = (side % 2, side / 2 == 1);
                let (mut next_low, mut next_high) = (low, high);
                let inside = match up {
                    true => high[axis] + 1 < grid.counts[axis],
                    false => low[axis] > 0,
                };
                if inside && up {
                    next_high[axis] += 1;
                } else if inside {
                    next_low[axis] -= 1;
                }
                *grows = inside && all(next_low, next_high);
                if *grows {
                    (low, high) = (next_low, next_high);
                }
            }
        }
        let [low, high] = [low, high].map(|cell| grid.place_m(cell));
        let borders = [
            (-Vector2::x(), -low.x),
            (Vector2::x(), high.x),
            (-Vector2::y(), -low.y),
            (Vector2::y(), high.y),
        ];
        let borders = borders.map(|(outward, at_m)| Border { outward, at_m }).to_vec();
        Some(Patch { plane: self.map.clone(), borders })
    }
}

/// Slope of the least-squares plane through the heights within a distance of a cell, and their largest deviation from it, m.
/// `None` at the rim of the grid.
fn plane_fit(grid: &ElevationGrid, cell: [usize; 2], radius_m: f64) -> Option<(f64, f64)> {
    let near = grid.around_cell(cell, radius_m);
    let middle = grid.place_m(cell);
    let reach = (radius_m / grid.spacing_m).floor() as usize;
    let inside = |k: usize| cell[k] >= reach && cell[k] + reach < grid.counts[k];
    if !(inside(0) && inside(1)) {
        return None;
    }
    // The cells are symmetric about the middle, so that the normal equations are diagonal.
    let mean = near.iter().map(|cell| grid.height_m(*cell)).sum::<f64>() / near.len() as f64;
    let (mut by_place, mut squares) = (Vector2::zeros(), 0.0);
    for cell in &near {
        let off = grid.place_m(*cell) - middle;
        by_place += off * grid.height_m(*cell);
        squares += off.x * off.x;
    }
    let slope: Vector2<f64> = by_place / squares.max(f64::MIN_POSITIVE);
    let deviation = |cell: &[usize; 2]| {
        (grid.height_m(*cell) - mean - slope.dot(&(grid.place_m(*cell) - middle))).abs()
    };
    Some((slope.norm(), near.iter().map(deviation).fold(0.0, f64::max)))
}

/// Maps of a sensed elevation map for one robot, as in a footing.
pub(super) struct Mapped {
    pub field: Arc<HeightField>,
    pub body: ElevationMap,
    pub rolled: Vec<Option<ElevationMap>>,
    pub envelopes: Vec<ElevationMap>,
    pub steppable: Vec<Option<Arc<Steppable>>>,
}

impl Mapped {
    /// Filters a sensed elevation map for a robot. Flags of `rolls` are set for the end effectors that never leave the ground.
    ///
    /// # Errors
    /// Returns an error if the grid is not valid, or if no height is known.
    pub fn new(
        sensed: &ElevationGrid,
        margins: &ContactMargins,
        robot: &Robot,
        rolls: &[bool],
    ) -> Result<Self, FieldError> {
        let spacing_m = sensed.spacing_m;
        let denoised = sensed.filled()?.median(1.5 * spacing_m);
        let smooth = denoised.blurred(spacing_m);
        let field = Arc::new(smooth.field()?);
        let spline = |grid: &ElevationGrid, deviation_m: f64| {
            let blurred = grid.blurred(deviation_m.max(spacing_m));
            Ok(ElevationMap::Field(Arc::new(blurred.field()?)))
        };
        let (mut rolled, mut envelopes, mut steppable) = (Vec::new(), Vec::new(), Vec::new());
        let mut previous = None;
        for (foot, never_lifts) in robot.end_effectors.iter().zip(rolls) {
            let is_wheel = foot.contact.rolls();
            let rolls = is_wheel && *never_lifts;
            let radius_m = if is_wheel { foot.radius_m } else { 0.0 };
            // Most robots have equal feet.
            if previous != Some((rolls, radius_m)) {
                let reach_m = margins.swing_reach_m + radius_m;
                let touched = || {
                    let closed = denoised.rolled(DISC * radius_m);
                    spline(&closed, WHEEL_DEVIATION * radius_m)
                };
                rolled.push(rolls.then(touched).transpose()?);
                let highest = denoised.highest(reach_m);
                envelopes.push(spline(&highest, swing_deviation_m(margins))?);
                let cells = || {
                    let margin_m = margins.margin_m.max(1.5 * spacing_m);
                    let highest = smooth.highest(reach_m);
                    Arc::new(Steppable::new(&field, &smooth, &highest, margin_m, reach_m))
                };
                steppable.push((!rolls).then(cells));
            } else {
                rolled.push(rolled[rolled.len() - 1].clone());
                envelopes.push(envelopes[envelopes.len() - 1].clone());
                steppable.push(steppable[steppable.len() - 1].clone());
            }
            previous = Some((rolls, radius_m));
        }
        let body = spline(&denoised, body_deviation_m(robot, margins))?;
        Ok(Self { field, body, rolled, envelopes, steppable })
    }
}
