//! Ground as a signed distance: gap, normal and curvature at a point (thesis 4.5).

mod contour;
mod convex;
mod elevation;
mod elevation_grid;
mod elevation_map;
mod facets;
pub mod file;
mod gaussian;
mod grid;
pub mod obstacle;
mod obstacle_file;
mod rotated;
mod shapes;
mod spline;
mod terrain;

use nalgebra::{Matrix3, Vector3};
use std::any::Any;
use std::fmt::Debug;
use std::sync::Arc;

pub use contour::{Contour, Filter};
pub use elevation::Elevation;
pub use elevation_grid::ElevationGrid;
pub use elevation_map::{Bump, ElevationMap};
pub use file::Terrain;
pub use grid::Grid;
pub use obstacle::{GroundWithObstacles, floor_of};
pub use rotated::RotatedGround;
pub use shapes::{Capsule, Cuboid, Plane, Rounded, Sphere, Union};
pub use spline::FieldError;
pub use terrain::{HeightField, Profile, ProfileError, Tread};

/// Gap, normal and curvature of the ground at a point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Surface {
    /// Distance from the ground, m; negative below the surface.
    pub gap_m: f64,
    /// Gradient of the gap. For a true distance it equals the normal.
    pub gradient: Vector3<f64>,
    /// Unit normal, out of the ground.
    pub normal: Vector3<f64>,
    /// Derivative of the normal with respect to the point, 1/m.
    pub curvature: Matrix3<f64>,
}

impl Surface {
    /// Surface for a true distance, whose gradient is a unit vector.
    fn exact(gap_m: f64, normal: Vector3<f64>, curvature: Matrix3<f64>) -> Self {
        Self { gap_m, gradient: normal, normal, curvature }
    }

    /// Surface of a level set. The function is 0 on the surface and grows outwards; its value, gradient and Hessian are given.
    /// The gap is the first-order distance f/|∇f|.
    fn of_level(value: f64, gradient: &Vector3<f64>, hessian: &Matrix3<f64>) -> Self {
        let slope = gradient.norm().max(f64::MIN_POSITIVE);
        let normal = gradient / slope;
        Self {
            gap_m: value / slope,
            gradient: normal - hessian * normal * (value / (slope * slope)),
            normal,
            curvature: (Matrix3::identity() - normal * normal.transpose()) * hessian / slope,
        }
    }
}

/// Immovable solid.
pub trait Ground: Any + Debug + Send + Sync {
    /// Evaluates the ground at a point in world axes, m.
    fn at(&self, point: &Vector3<f64>) -> Surface;

    /// Returns true if the gap is the exact distance at all points outside. Spheres and wheels then touch at the point nearest
    /// to their centre, edges included. Otherwise they touch at the deepest point of their own surface.
    fn is_distance(&self) -> bool {
        false
    }

    /// Parts that an object can touch simultaneously; empty if the ground is a single part. The nearest part determines the
    /// gap.
    fn parts(&self) -> Vec<Arc<dyn Ground>> {
        Vec::new()
    }
}

/// Parts of a ground, or the ground itself if it is a single part.
pub fn parts_of(ground: &Arc<dyn Ground>) -> Vec<Arc<dyn Ground>> {
    let parts = ground.parts();
    if parts.is_empty() { vec![Arc::clone(ground)] } else { parts }
}

/// Panics if gradient or curvature differ from central differences at a point.
#[cfg(test)]
fn agrees_with_finite_differences(ground: &dyn Ground, point: &Vector3<f64>) {
    let step = 1e-6;
    let surface = ground.at(point);
    assert!((surface.normal.norm() - 1.0).abs() < 1e-12, "{ground:?}");
    for axis in 0..3 {
        let at = |by: f64| {
            let mut point = *point;
            point[axis] += by;
            ground.at(&point)
        };
        let (ahead, behind) = (at(step), at(-step));
        let slope = (ahead.gap_m - behind.gap_m) / (2.0 * step);
        let bound = 1e-8 * (1.0 + surface.curvature.norm());
        assert!((slope - surface.gradient[axis]).abs() < bound, "{ground:?} at {point:?}");
        let bend = (ahead.normal - behind.normal) / (2.0 * step);
        let error = (bend - surface.curvature.column(axis)).norm();
        assert!(error < 10.0 * bound, "{ground:?} at {point:?}: {error}");
    }
}
