//! Ground as a height over the x-y plane, with its first two derivatives, as the planner requires. A solid with walls or
//! overhangs has no such height.

use super::{Contour, Elevation, HeightField};
use nalgebra::{Matrix2, Matrix3, Rotation2, Vector2, Vector3};
use std::sync::Arc;

/// Maximum number of Newton steps to the contact point of a rim.
const ROUNDS: usize = 20;
/// Number of lengths that are tried for a step, each half of the one before.
const HALVINGS: i32 = 8;
/// Error of a contact point, m.
const CONTACT_ERROR_M: f64 = 1e-12;

/// Height of the ground over the x-y plane.
#[derive(Clone, Debug, PartialEq)]
pub enum ElevationMap {
    /// Level ground at a height, m.
    Level(f64),
    /// Plane through the point of the given height above the origin, m, with the given gradient.
    Plane {
        /// Height at the origin, m.
        height_m: f64,
        /// Gradient of the height.
        slope: Vector2<f64>,
    },
    /// Heights along x.
    Contour(Arc<Contour>),
    /// Spline through heights on a grid.
    Field(Arc<HeightField>),
    /// Map whose x axis points along a heading, rad.
    Turned(f64, Arc<Self>),
    /// Map that is raised by a smooth bump.
    Raised(Arc<Self>, Bump),
}

/// Smooth bump w(s) = b (1 − s²)³ of height b, with s = |x − c|/R for the centre c and the radius R. Beyond R it is 0.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bump {
    /// Centre c, m.
    pub center_m: Vector2<f64>,
    /// Height b, m; negative for a hollow.
    pub height_m: f64,
    /// Radius R, m.
    pub radius_m: f64,
}

impl Bump {
    fn elevation(&self, at: Vector2<f64>) -> Elevation {
        let (off, square) = (at - self.center_m, self.radius_m * self.radius_m);
        let rest = 1.0 - off.norm_squared() / square;
        if rest <= 0.0 {
            return Elevation::default();
        }
        let by_square = -6.0 * self.height_m / square;
        Elevation {
            height_m: self.height_m * rest.powi(3),
            slope: off * (by_square * rest * rest),
            bend: (Matrix2::identity() * rest - off * off.transpose() * (4.0 / square))
                * (by_square * rest),
        }
    }
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

    /// Map that is turned about the vertical through the origin, so that its x axis points along a heading, rad.
    pub fn turned(self, heading_rad: f64) -> Self {
        match self {
            Self::Level(_) => self,
            _ if heading_rad == 0.0 => self,
            Self::Plane { height_m, slope } => {
                Self::Plane { height_m, slope: Rotation2::new(heading_rad) * slope }
            }
            other => Self::Turned(heading_rad, Arc::new(other)),
        }
    }

    /// Map that is raised around a point so that it passes through the point. The slope there does not change. Beyond
    /// `radius_m` nothing changes.
    pub fn through(self, point: &Vector3<f64>, radius_m: f64) -> Self {
        let (center_m, height_m) = (point.xy(), self.height_above_m(point));
        Self::Raised(Arc::new(self), Bump { center_m, height_m, radius_m })
    }

    /// Elevation at the x and y of a point.
    pub fn at(&self, point: &Vector3<f64>) -> Elevation {
        self.at_xy(point.xy())
    }

    fn at_xy(&self, at: Vector2<f64>) -> Elevation {
        match self {
            Self::Level(height_m) => Elevation { height_m: *height_m, ..Elevation::default() },
            Self::Plane { height_m, slope } => Elevation {
                height_m: height_m + slope.dot(&at),
                slope: *slope,
                bend: Matrix2::zeros(),
            },
            Self::Contour(contour) => contour.elevation(at.x),
            Self::Field(field) => field.elevation(at.x, at.y),
            Self::Turned(heading_rad, map) => {
                let turn = Rotation2::new(*heading_rad);
                let Elevation { height_m, slope, bend } = map.at_xy(turn.inverse() * at);
                let (turn, back) = (turn.matrix(), turn.matrix().transpose());
                Elevation { height_m, slope: turn * slope, bend: turn * bend * back }
            }
            Self::Raised(map, bump) => {
                let (below, over) = (map.at_xy(at), bump.elevation(at));
                Elevation {
                    height_m: below.height_m + over.height_m,
                    slope: below.slope + over.slope,
                    bend: below.bend + over.bend,
                }
            }
        }
    }

    /// Height of a point above the ground, m.
    pub fn height_above_m(&self, point: &Vector3<f64>) -> f64 {
        point.z - self.at(point).height_m
    }

    /// Unit normal where a rim or sphere touches the ground. `rim` returns the vector ρ from the centre to the contact point for
    /// a normal n, and ∂ρ/∂n.
    ///
    /// The contact point e solves c + ρ(n(e)) = e: Newton's method with steps that reduce the residual. A fixed-point iteration
    /// would diverge on edges, where the ground bends more than the rim.
    pub fn normal_below(
        &self,
        center: &Vector3<f64>,
        rim: impl Fn(&Vector3<f64>) -> (Vector3<f64>, Matrix3<f64>),
    ) -> Vector3<f64> {
        if self.is_level() {
            return Vector3::z();
        }
        let residual = |at: &Vector2<f64>| {
            let here = self.at_xy(*at);
            let (to_contact, by_normal) = rim(&here.normal());
            let off = (center + to_contact).xy() - at;
            (off, (by_normal * here.d_normal()).fixed_rows::<2>(0) - Matrix2::identity())
        };
        let mut at = (center + rim(&Vector3::z()).0).xy();
        let (mut off, mut by_place) = residual(&at);
        for _ in 0..ROUNDS {
            if off.amax() < CONTACT_ERROR_M {
                break;
            }
            let step = by_place.lu().solve(&-off).unwrap_or(off);
            let shorter = (0..HALVINGS).map(|k| at + step * 0.5f64.powi(k));
            let mut tried = shorter.map(|next| (next, residual(&next)));
            let Some((next, evaluated)) = tried.find(|(_, (next, _))| next.norm() < off.norm())
            else {
                break;
            };
            at = next;
            (off, by_place) = evaluated;
        }
        self.at_xy(at).normal()
    }

    /// First-order distance of a point from the ground, (z − h)/|ν|, m, and its gradient.
    pub fn distance(&self, point: &Vector3<f64>) -> (f64, Vector3<f64>) {
        if let Self::Level(height_m) = self {
            return (point.z - height_m, Vector3::z());
        }
        let below = self.at(point);
        let upward = below.upward();
        let length = upward.norm();
        let distance_m = (point.z - below.height_m) / length;
        let d_length = below.bend * below.slope / length;
        let d_length = Vector3::new(d_length.x, d_length.y, 0.0);
        (distance_m, (upward - d_length * distance_m) / length)
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

    /// Tests a sphere on an edge that is rounded far more sharply than the sphere.
    #[test]
    fn a_sphere_touches_a_sharp_edge_where_its_centre_says() {
        let (radius_m, height_m) = (0.1, 0.04);
        let step = crate::ground::Profile::step(0.0, height_m).unwrap();
        let contour = Contour::of(&step, crate::ground::Filter::Rolled(1.2 * radius_m), 0.008);
        let map = ElevationMap::Contour(Arc::new(contour));
        let rim = |n: &Vector3<f64>| (n * -radius_m, Matrix3::identity() * -radius_m);
        for k in 0..200 {
            let contact = Vector3::new(0.001 * f64::from(k) - 0.12, 0.0, 0.0);
            let here = map.at(&contact);
            let center = contact + Vector3::z() * here.height_m + here.normal() * radius_m;
            let found = map.normal_below(&center, rim);
            // Equal centres may have two contact points only where the rim bends like the ground.
            let touches = center - found * radius_m;
            assert!(map.height_above_m(&touches).abs() < 1e-9, "{contact:?}: {touches:?}");
        }
    }

    #[test]
    fn a_raised_map_passes_through_its_point_and_has_its_derivatives() {
        let slope = Vector2::new(0.1, -0.05);
        let plane = ElevationMap::Plane { height_m: 0.02, slope };
        let point = Vector3::new(0.3, -0.2, 0.09);
        let map = plane.clone().through(&point, 0.15);
        assert!(map.height_above_m(&point).abs() < 1e-15);
        assert!((map.at(&point).slope - slope).amax() < 1e-15);
        let mut rng = fastrand::Rng::with_seed(5);
        for _ in 0..100 {
            let at = point + Vector3::from_fn(|_, _| 0.4 * (rng.f64() - 0.5));
            let here = map.at(&at);
            if (at - point).xy().norm() > 0.15 {
                assert_eq!(here, plane.at(&at));
            }
            let step = 1e-6;
            for axis in 0..2 {
                let by = |by: f64| map.at(&(at + Vector3::ith(axis, by)));
                let (ahead, behind) = (by(step), by(-step));
                let numeric = (ahead.height_m - behind.height_m) / (2.0 * step);
                assert!((numeric - here.slope[axis]).abs() < 1e-8);
                let numeric = (ahead.slope - behind.slope) / (2.0 * step);
                assert!((numeric - here.bend.column(axis)).amax() < 1e-6);
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
