//! Ground as a height over every point of the x-y plane, with its first two derivatives: what the equations of a planner
//! ask of it. A solid with walls or overhangs has no such height.

use super::HeightField;
use nalgebra::{Matrix2, Matrix3x2, Vector2, Vector3};
use std::sync::Arc;

/// Height of the ground over x and y.
#[derive(Clone, Debug, PartialEq)]
pub enum ElevationMap {
    /// Level ground at this height, m.
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

/// Height of the ground at a point of the x-y plane.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Elevation {
    /// Height, m.
    pub height_m: f64,
    /// Gradient (p, q) of the height.
    pub slope: Vector2<f64>,
    /// Hessian of the height, 1/m.
    pub bend: Matrix2<f64>,
}

impl ElevationMap {
    /// True for ground of one height everywhere. Rows of an equation then have no derivatives by where a point is.
    pub fn is_level(&self) -> bool {
        matches!(self, Self::Level(_))
    }

    /// Elevation below or above a point.
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

    /// Distance of a point from the ground to first order, (z − h)/|ν|, m, with its gradient.
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

impl Elevation {
    /// Gradient ν = (−p, −q, 1) of the height above the ground of a point here, z − h(x, y).
    pub fn upward(&self) -> Vector3<f64> {
        Vector3::z() - Vector3::new(self.slope.x, self.slope.y, 0.0)
    }

    /// Unit normal n = ν/|ν|, out of the ground.
    pub fn normal(&self) -> Vector3<f64> {
        let upward = self.upward();
        upward / upward.norm()
    }

    /// Derivative of the normal by x and y, (I − n nᵀ) ∂ν/|ν|, 1/m.
    pub fn d_normal(&self) -> Matrix3x2<f64> {
        let upward = self.upward();
        let mut d_upward = Matrix3x2::zeros();
        d_upward.fixed_rows_mut::<2>(0).copy_from(&-self.bend);
        let normal = upward / upward.norm();
        (d_upward - normal * (normal.transpose() * d_upward)) / upward.norm()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ground::Ground;

    /// h = 0.1 sin 3x cos 2y at (0.3, 0.4).
    fn wave() -> Elevation {
        let ((sx, cx), (sy, cy)) = (0.9_f64.sin_cos(), 0.8_f64.sin_cos());
        let bend = [[-0.9 * sx * cy, -0.6 * cx * sy], [-0.6 * cx * sy, -0.4 * sx * cy]];
        Elevation {
            height_m: 0.1 * sx * cy,
            slope: Vector2::new(0.3 * cx * cy, -0.2 * sx * sy),
            bend: bend.into(),
        }
    }

    #[test]
    fn the_normal_of_a_wave_is_that_of_its_closed_form() {
        let expected = Vector3::new(-0.128_048, 0.110_762, 0.985_563);
        let d_expected = Vector3::new(0.479_886, 0.267_318, 0.032_306);
        assert!((wave().normal() - expected).amax() < 1e-6);
        assert!((wave().d_normal().column(0) - d_expected).amax() < 1e-6);
    }

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
        // To the sign of its zeros.
        let normal = level.at(&point).normal();
        assert_eq!(normal.map(f64::to_bits), Vector3::z().map(f64::to_bits));
    }
}
