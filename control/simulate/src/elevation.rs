//! Simulated sensor of an elevation map: heights of the true ground around the robot, with noise, holes and delay.
//!
//! The sensor is independent of clock and planner. It knows the pose of the robot, so that maps are in world axes without
//! drift.

use crate::sensors::normal;
use fastrand::Rng;
use nalgebra::Vector2;
use rollwalk_multibody::ground::{ElevationGrid, Terrain};
use rollwalk_planner::receding::HorizonGround;
use std::collections::VecDeque;
use std::sync::Arc;

/// Half width of the square around the body that a map covers, m.
const HALF_M: f64 = 0.8;
/// Distance between the cells of a map, m.
const SPACING_M: f64 = 0.02;
/// Number of cells along an edge of a hole.
const HOLE_CELLS: usize = 3;
/// Seed of noise and holes.
const SEED: u64 = 1;

/// Quality of a sensed map.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sensing {
    /// Standard deviation of each height, m. Errors of cells and maps are independent.
    pub noise_m: f64,
    /// Fraction of the map that is unknown.
    pub holes: f64,
    /// Time from the measurement until the map arrives, s.
    pub delay_s: f64,
}

impl Default for Sensing {
    /// Values of depth cameras at a distance of a metre.
    fn default() -> Self {
        Self { noise_m: 0.003, holes: 0.05, delay_s: 0.2 }
    }
}

/// Sensor of elevation maps.
#[derive(Clone, Debug)]
pub struct ElevationSensor {
    terrain: Terrain,
    sensing: Sensing,
    random: Rng,
    /// Maps that have not arrived yet, with their times of measurement, s, in order.
    waiting: VecDeque<(f64, ElevationGrid)>,
}

impl ElevationSensor {
    /// Creates a sensor over a terrain.
    pub fn new(terrain: Terrain, sensing: Sensing) -> Self {
        let (random, waiting) = (Rng::with_seed(SEED), VecDeque::new());
        Self { terrain, sensing, random, waiting }
    }

    /// Map of a robot that has stood still for longer than the delay.
    pub fn first(&mut self, body_m: &Vector2<f64>) -> HorizonGround {
        HorizonGround::Map(Arc::new(self.measure(body_m)))
    }

    /// Measures a map around the body. Returns the newest map that has arrived since the previous call, if any.
    pub fn sample(&mut self, time_s: f64, body_m: &Vector2<f64>) -> Option<HorizonGround> {
        let grid = self.measure(body_m);
        self.waiting.push_back((time_s, grid));
        let until_s = time_s - self.sensing.delay_s + 1e-9;
        let mut newest = None;
        while self.waiting.front().is_some_and(|(measured_s, _)| *measured_s <= until_s) {
            newest = self.waiting.pop_front();
        }
        newest.map(|(_, grid)| HorizonGround::Map(Arc::new(grid)))
    }

    fn measure(&mut self, body_m: &Vector2<f64>) -> ElevationGrid {
        let Self { terrain, sensing: Sensing { noise_m, holes, .. }, random, .. } = self;
        let mut grid = ElevationGrid::around(*body_m, HALF_M, SPACING_M, |at| {
            terrain.height_m(&at) + *noise_m * normal(random)
        });
        let [columns, rows] = grid.counts;
        let cells_per_hole = (HOLE_CELLS * HOLE_CELLS) as f64;
        for _ in 0..(*holes * (columns * rows) as f64 / cells_per_hole).round() as usize {
            let [i, j] = [columns, rows].map(|count| random.usize(0..count));
            for row in j..(j + HOLE_CELLS).min(rows) {
                let first = row * columns + i;
                let last = row * columns + (i + HOLE_CELLS).min(columns);
                grid.heights_m[first..last].fill(f64::NAN);
            }
        }
        grid
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rollwalk_multibody::ground::file::from_toml;

    fn sensor(sensing: Sensing) -> ElevationSensor {
        let step = "[step]\nat_x_m = 0.5\nheight_m = 0.03";
        ElevationSensor::new(from_toml("step.toml", step).unwrap(), sensing)
    }

    fn grid(map: HorizonGround) -> Arc<ElevationGrid> {
        let HorizonGround::Map(grid) = map else { panic!("{map:?}") };
        grid
    }

    #[test]
    fn a_map_has_the_heights_noise_and_holes_of_its_sensor() {
        let exact = Sensing { noise_m: 0.0, holes: 0.0, delay_s: 0.0 };
        let body = Vector2::new(0.2, -0.1);
        let map = grid(sensor(exact).first(&body));
        let height_m = |x: f64| map.height_m(map.nearest(&Vector2::new(x, 0.0)));
        assert_eq!([height_m(0.44), height_m(0.56)], [0.0, 0.03]);
        let noisy = grid(sensor(Sensing { noise_m: 0.004, holes: 0.1, ..exact }).first(&body));
        let off = noisy.heights_m.iter().zip(&map.heights_m).map(|(noisy, exact)| noisy - exact);
        let known: Vec<f64> = off.filter(|off| !off.is_nan()).collect();
        let unknown = 1.0 - known.len() as f64 / map.heights_m.len() as f64;
        // Holes overlap.
        assert!((0.08..0.1).contains(&unknown), "{unknown}");
        let deviation =
            (known.iter().map(|off| off * off).sum::<f64>() / known.len() as f64).sqrt();
        assert!((deviation / 0.004 - 1.0).abs() < 0.05, "{deviation}");
    }

    #[test]
    fn a_map_arrives_after_its_delay() {
        let mut sensor = sensor(Sensing { noise_m: 0.0, holes: 0.0, delay_s: 0.2 });
        let mut at = |k: u32| {
            let place = Vector2::new(0.02 * f64::from(k), 0.0);
            let map = sensor.sample(0.1 * f64::from(k), &place)?;
            Some(grid(map).origin_m[0] + HALF_M)
        };
        let seen: Vec<_> = (0..5).map(|k| at(k).map(|x| (x / 0.02).round())).collect();
        assert_eq!(seen, [None, None, Some(0.0), Some(1.0), Some(2.0)]);
    }
}
