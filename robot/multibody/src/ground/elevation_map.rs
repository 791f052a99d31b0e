//! Ground as a height over the x-y plane, with its first two derivatives, as the planner requires. A solid with walls or
//! overhangs has no such height.

use super::{Elevation, HeightField};
use nalgebra::Vector3;
use std::sync::Arc;

/// Height of the ground over the x-y plane.
#[derive(Clone, Debug, PartialEq)]
pub enum ElevationMap {
    /// Level ground at a height, m.
    Level(f64),
    /// Spline through heights on a grid.
    Field(Arc<HeightField>),
}

impl Default for ElevationMap {
    /// The plane z = 0.
    fn default() -> Self {
        Self::Level(0.0)
    }
}

impl ElevationMap {
    /// Returns true if the ground has constant height. Rows of an equation then have no derivatives with respect to the
    /// position on the ground.
    pub fn is_level(&self) -> bool {
        matches!(self, Self::Level(_))
    }

    /// Elevation at the x and y of a point.
    pub fn at(&self, point: &Vector3<f64>) -> Elevation {
        match self {
            Self::Level(height_m) => Elevation { height_m: *height_m, ..Elevation::default() },
            Self::Field(field) => field.elevation(point.x, point.y),
        }
    }

    /// Height of a point above the ground, m.
    pub fn height_above_m(&self, point: &Vector3<f64>) -> f64 {
        match self {
            Self::Level(height_m) => point.z - height_m,
            Self::Field(field) => point.z - field.elevation(point.x, point.y).height_m,
        }
    }

    /// First-order distance of a point from the ground, (z − h)/|ν|, m, and its gradient.
    pub fn distance(&self, point: &Vector3<f64>) -> (f64, Vector3<f64>) {
        match self {
            Self::Level(height_m) => (point.z - height_m, Vector3::z()),
            Self::Field(field) => {
                let below = field.elevation(point.x, point.y);
                let upward = below.upward();
                let length = upward.norm();
                let distance_m = (point.z - below.height_m) / length;
                let d_length = below.bend * below.slope / length;
                let d_length = Vector3::new(d_length.x, d_length.y, 0.0);
                (distance_m, (upward - d_length * distance_m) / length)
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ground::Ground;

    #[test]
    fn elevations_of_a_field_have_their_derivatives_and_agree_with_its_surface() {
        let mut rng = fastrand::Rng::with_seed(3);
        let heights_m = (0..49).map(|_| 0.1 * rng.f64()).collect();
        let field = Arc::new(HeightField::new([-0.6; 2], 0.2, [7, 7], heights_m).unwrap());
        let map = ElevationMap::Field(Arc::clone(&field));
        for _ in 0..100 {
            let point = Vector3::from_fn(|_, _| 1.4 * (rng.f64() - 0.5));
            let here = map.at(&point);
            let (distance_m, gradient) = map.distance(&point);
            let surface = field.at(&point);
            assert!((distance_m - surface.gap_m).abs() < 1e-14);
            assert!((gradient - surface.gradient).amax() < 1e-12);
            assert!((here.normal() - surface.normal).amax() < 1e-14);
            let curvature = surface.curvature.fixed_columns::<2>(0).into_owned();
            assert!((here.d_normal() - curvature).amax() < 1e-12);
            let step = 1e-6;
            for axis in 0..2 {
                let at = |by: f64| map.height_above_m(&(point + Vector3::ith(axis, by)));
                let numeric = (at(step) - at(-step)) / (2.0 * step);
                assert!((numeric - here.upward()[axis]).abs() < 1e-8);
            }
        }
    }

    #[test]
    fn level_ground_is_exact() {
        let point = Vector3::new(0.3, -0.2, 0.1 + 0.2);
        let level = ElevationMap::default();
        assert_eq!(level.height_above_m(&point), point.z);
        assert_eq!(level.distance(&point), (point.z, Vector3::z()));
        // Equal including the sign of zeros.
        let normal = level.at(&point).normal();
        assert_eq!(normal.map(f64::to_bits), Vector3::z().map(f64::to_bits));
    }
}
