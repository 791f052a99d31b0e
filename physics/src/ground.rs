//! Ground as a signed distance: gap, normal and curvature at a point (thesis 4.5).

use nalgebra::{Matrix3, Vector3};

/// The ground as seen from a point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Surface {
    /// Distance from the ground, m; negative inside.
    pub gap_m: f64,
    /// Unit vector out of the ground: the gradient of the gap.
    pub normal: Vector3<f64>,
    /// Derivative of the normal by the point, 1/m: the Hessian of the gap.
    pub curvature: Matrix3<f64>,
}

/// Something solid that does not move.
pub trait Ground: std::fmt::Debug + Send + Sync {
    /// The ground as seen from a point in world axes, m.
    fn at(&self, point: &Vector3<f64>) -> Surface;
}

/// Everything on one side of a plane.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Plane {
    /// A point of the plane, m.
    pub point: Vector3<f64>,
    /// Unit normal, out of the ground.
    pub normal: Vector3<f64>,
}

impl Plane {
    /// The level plane z = 0.
    pub fn level() -> Self {
        Self { point: Vector3::zeros(), normal: Vector3::z() }
    }

    /// A plane through the origin that rises along x by an angle, rad.
    pub fn rising(angle_rad: f64) -> Self {
        let (sine, cosine) = angle_rad.sin_cos();
        Self { point: Vector3::zeros(), normal: Vector3::new(-sine, 0.0, cosine) }
    }
}

impl Ground for Plane {
    fn at(&self, point: &Vector3<f64>) -> Surface {
        Surface {
            gap_m: self.normal.dot(&(point - self.point)),
            normal: self.normal,
            curvature: Matrix3::zeros(),
        }
    }
}

/// A ball.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sphere {
    /// Its centre, m.
    pub center: Vector3<f64>,
    /// Its radius, m.
    pub radius_m: f64,
}

impl Ground for Sphere {
    fn at(&self, point: &Vector3<f64>) -> Surface {
        let from_center = point - self.center;
        // At the centre any direction is out.
        let distance = from_center.norm().max(f64::MIN_POSITIVE);
        let normal = from_center / distance;
        let curvature = (Matrix3::identity() - normal * normal.transpose()) / distance;
        Surface { gap_m: distance - self.radius_m, normal, curvature }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn normal_and_curvature_are_derivatives_of_the_gap() {
        let grounds: [&dyn Ground; 3] = [
            &Plane::level(),
            &Plane::rising(0.2),
            &Sphere { center: Vector3::new(0.1, -0.2, 0.3), radius_m: 0.5 },
        ];
        let (point, step) = (Vector3::new(0.7, 0.4, -0.3), 1e-6);
        for ground in grounds {
            let surface = ground.at(&point);
            for axis in 0..3 {
                let at = |by: f64| {
                    let mut point = point;
                    point[axis] += by;
                    ground.at(&point)
                };
                let (ahead, behind) = (at(step), at(-step));
                let slope = (ahead.gap_m - behind.gap_m) / (2.0 * step);
                assert!((slope - surface.normal[axis]).abs() < 1e-9, "{ground:?}");
                let bend = (ahead.normal - behind.normal) / (2.0 * step);
                assert!((bend - surface.curvature.column(axis)).norm() < 1e-9, "{ground:?}");
            }
        }
    }
}
