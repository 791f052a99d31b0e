//! Signed distances in closed form: plane, sphere, capsule, cuboid; rounded solids and unions.

use super::{Ground, Surface, parts_of};
use nalgebra::{Isometry3, Matrix3, Point3, Vector3};
use std::sync::Arc;

/// Half-space below a plane.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Plane {
    /// Point of the plane, m.
    pub point: Vector3<f64>,
    /// Unit normal, out of the ground.
    pub normal: Vector3<f64>,
}

impl Plane {
    /// Level plane z = 0.
    pub fn level() -> Self {
        Self { point: Vector3::zeros(), normal: Vector3::z() }
    }

    /// Plane through the origin that rises along x by an angle, rad.
    pub fn rising(angle_rad: f64) -> Self {
        let (sine, cosine) = angle_rad.sin_cos();
        Self { point: Vector3::zeros(), normal: Vector3::new(-sine, 0.0, cosine) }
    }
}

impl Ground for Plane {
    fn is_distance(&self) -> bool {
        true
    }

    fn at(&self, point: &Vector3<f64>) -> Surface {
        let gap_m = self.normal.dot(&(point - self.point));
        Surface::exact(gap_m, self.normal, Matrix3::zeros())
    }
}

/// Ball.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sphere {
    /// Centre, m.
    pub center: Vector3<f64>,
    /// Radius, m.
    pub radius_m: f64,
}

/// Surface of a thin object, such as a point or a line. `from_nearest` is the vector from its nearest point. `free` projects
/// onto the directions in which the nearest point does not follow.
fn distance(from_nearest: &Vector3<f64>, free: &Matrix3<f64>) -> Surface {
    // At the curve itself, any direction leads out.
    let gap_m = from_nearest.norm().max(f64::MIN_POSITIVE);
    let normal = from_nearest / gap_m;
    Surface::exact(gap_m, normal, (free - normal * normal.transpose()) / gap_m)
}

impl Ground for Sphere {
    fn is_distance(&self) -> bool {
        true
    }

    fn at(&self, point: &Vector3<f64>) -> Surface {
        let surface = distance(&(point - self.center), &Matrix3::identity());
        Surface { gap_m: surface.gap_m - self.radius_m, ..surface }
    }
}

/// Capsule: all points within a radius of a line segment.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Capsule {
    /// Ends of the segment, m.
    pub ends: [Vector3<f64>; 2],
    /// Radius, m.
    pub radius_m: f64,
}

impl Ground for Capsule {
    fn is_distance(&self) -> bool {
        true
    }

    fn at(&self, point: &Vector3<f64>) -> Surface {
        let line = self.ends[1] - self.ends[0];
        let share = line.dot(&(point - self.ends[0])) / line.norm_squared().max(f64::MIN_POSITIVE);
        let mut free = Matrix3::identity();
        if (0.0..1.0).contains(&share) {
            free -= line * line.transpose() / line.norm_squared();
        }
        let nearest = self.ends[0] + line * share.clamp(0.0, 1.0);
        let surface = distance(&(point - nearest), &free);
        Surface { gap_m: surface.gap_m - self.radius_m, ..surface }
    }
}

/// Box in any pose.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cuboid {
    /// Pose of the box's centre in world axes. The axes are parallel to the edges.
    pub world_from_box: Isometry3<f64>,
    /// Half edge lengths, m.
    pub half_m: Vector3<f64>,
}

impl Ground for Cuboid {
    fn is_distance(&self) -> bool {
        true
    }

    fn at(&self, point: &Vector3<f64>) -> Surface {
        let inside = self.world_from_box.inverse_transform_point(&Point3::from(*point)).coords;
        let over = inside.abs() - self.half_m;
        let sign = inside.map(f64::signum);
        let surface = if over.max() <= 0.0 {
            // The shortest way out is through the nearest face.
            let face = over.imax();
            let mut normal = Vector3::zeros();
            normal[face] = sign[face];
            Surface::exact(over[face], normal, Matrix3::zeros())
        } else {
            // Nearest to a face, an edge or a corner: only coordinates outside the box count.
            let from_nearest = over.map(|part| part.max(0.0)).component_mul(&sign);
            let free = Matrix3::from_diagonal(&over.map(|part| f64::from(u8::from(part > 0.0))));
            distance(&from_nearest, &free)
        };
        let turn = self.world_from_box.rotation.to_rotation_matrix().into_inner();
        let curvature = turn * surface.curvature * turn.transpose();
        Surface::exact(surface.gap_m, turn * surface.normal, curvature)
    }
}

/// Solid that is enlarged by a radius, which rounds its edges.
#[derive(Clone, Debug)]
pub struct Rounded {
    /// Solid to be enlarged.
    pub inner: Arc<dyn Ground>,
    /// Radius of the enlargement, m.
    pub radius_m: f64,
}

impl Ground for Rounded {
    fn is_distance(&self) -> bool {
        self.inner.is_distance()
    }

    fn at(&self, point: &Vector3<f64>) -> Surface {
        let surface = self.inner.at(point);
        Surface { gap_m: surface.gap_m - self.radius_m, ..surface }
    }
}

/// Union of several solids. The gap is that of the nearest solid, which is the exact distance outside.
#[derive(Clone, Debug)]
pub struct Union {
    /// Solids; never empty.
    pub parts: Vec<Arc<dyn Ground>>,
}

impl Ground for Union {
    fn is_distance(&self) -> bool {
        self.parts.iter().all(|part| part.is_distance())
    }

    fn parts(&self) -> Vec<Arc<dyn Ground>> {
        self.parts.iter().flat_map(parts_of).collect()
    }

    fn at(&self, point: &Vector3<f64>) -> Surface {
        let seen = self.parts.iter().map(|part| part.at(point));
        seen.min_by(|a, b| a.gap_m.total_cmp(&b.gap_m)).expect("a union has parts")
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ground::agrees_with_finite_differences;

    fn random(rng: &mut fastrand::Rng, size: f64) -> Vector3<f64> {
        Vector3::from_fn(|_, _| size * (2.0 * rng.f64() - 1.0))
    }

    #[test]
    fn gradient_and_curvature_of_all_shapes_agree_with_finite_differences() {
        let ball = Sphere { center: Vector3::new(0.1, -0.2, 0.3), radius_m: 0.5 };
        let turned = Isometry3::new(Vector3::new(0.2, 0.1, -0.1), Vector3::new(0.3, -0.2, 0.5));
        let cuboid = Cuboid { world_from_box: turned, half_m: Vector3::new(0.3, 0.2, 0.4) };
        let ends = [Vector3::new(-0.3, 0.1, 0.0), Vector3::new(0.2, 0.1, 0.3)];
        let capsule = Capsule { ends, radius_m: 0.1 };
        let rounded = Rounded { inner: Arc::new(cuboid), radius_m: 0.05 };
        let union = Union { parts: vec![Arc::new(ball), Arc::new(rounded.clone())] };
        let grounds: [&dyn Ground; 7] =
            [&Plane::level(), &Plane::rising(0.2), &ball, &cuboid, &capsule, &rounded, &union];
        let mut rng = fastrand::Rng::with_seed(1);
        for ground in grounds {
            for _ in 0..100 {
                agrees_with_finite_differences(ground, &random(&mut rng, 1.0));
            }
        }
    }

    /// Tests that distances are 1-Lipschitz, and that the surface lies at the gap along the normal.
    #[test]
    fn the_foot_of_the_normal_is_on_the_surface() {
        let turned = Isometry3::new(Vector3::zeros(), Vector3::new(0.3, -0.2, 0.5));
        let cuboid = Cuboid { world_from_box: turned, half_m: Vector3::new(0.3, 0.2, 0.4) };
        let capsule = Capsule { ends: [Vector3::zeros(), Vector3::x()], radius_m: 0.1 };
        let mut rng = fastrand::Rng::with_seed(2);
        for ground in [&cuboid as &dyn Ground, &capsule] {
            for _ in 0..100 {
                let point = random(&mut rng, 1.0);
                let surface = ground.at(&point);
                let foot = point - surface.normal * surface.gap_m;
                assert!(ground.at(&foot).gap_m.abs() < 1e-12, "{ground:?} at {point:?}");
            }
        }
    }
}
