//! Distances between shapes of links, with gradients: capsule to capsule, capsule to box, and both to the ground. Used for
//! clearance between limbs, to the body and to the ground.
//!
//! A distance is between surfaces; where shapes overlap it is minus the depth. Gradients follow from Danskin's theorem: with
//! the nearest points p and q fixed on their shapes, the distance changes by n · (dp − dq), n = (p − q) / |p − q|. This is
//! exact if the nearest points are unique. Otherwise, as between parallel capsules, it is one of the two one-sided gradients.
//!
//! `parry3d` is unsuitable because it has no gradients. Its iterations for capsules and boxes (GJK, EPA) end at a tolerance,
//! below which a distance is neither smooth nor monotonic. It also uses the vectors of another library.

use nalgebra::{Matrix3, Vector3};
use rollwalk_robot::shape::Shape;

/// Distance between axes below which their direction is undefined, m.
const TOUCHING_M: f64 = 1e-12;
/// Rounding of a distance, m. The search ends if further improvement is below this value.
const ROUNDING_M: f64 = 1e-16;
/// Maximum number of steps along a capsule's axis. About five suffice outside a box, up to fifty inside.
const STEPS: usize = 100;

/// Capsule in world axes: all points within a radius of a line segment.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Capsule {
    /// Start and end of the segment, m.
    pub ends: [Vector3<f64>; 2],
    /// Radius, m.
    pub radius_m: f64,
}

/// Box in world axes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct OrientedBox {
    /// Centre, m.
    pub center: Vector3<f64>,
    /// World-from-box rotation.
    pub world_from_box: Matrix3<f64>,
    /// Half side lengths along the axes of the box, m.
    pub half_size_m: Vector3<f64>,
}

/// Distance between two capsules.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CapsuleDistance {
    /// Distance between the surfaces, m; negative if they overlap.
    pub distance_m: f64,
    /// Gradient with respect to the ends of the first capsule.
    pub by_first: [Vector3<f64>; 2],
    /// Gradient with respect to the ends of the second capsule.
    pub by_second: [Vector3<f64>; 2],
}

/// Distance between a capsule and a box.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BoxDistance {
    /// Distance between the surfaces, m; negative if they overlap.
    pub distance_m: f64,
    /// Gradient with respect to the ends of the capsule.
    pub by_ends: [Vector3<f64>; 2],
    /// Gradient with respect to the centre of the box.
    pub by_center: Vector3<f64>,
    /// Gradient with respect to a rotation of the box about its centre, in world axes, m/rad.
    pub by_rotation: Vector3<f64>,
}

impl Capsule {
    /// Capsule of a link with the pose `origin` and `world_from_link`; `None` for a box.
    pub fn of(
        shape: &Shape,
        origin: &Vector3<f64>,
        world_from_link: &Matrix3<f64>,
    ) -> Option<Self> {
        let Shape::Capsule { from_in_link_m, to_in_link_m, radius_m } = shape else { return None };
        let ends = [from_in_link_m, to_in_link_m].map(|end| origin + world_from_link * end);
        Some(Self { ends, radius_m: *radius_m })
    }

    /// Distance to another capsule. The depth is at most the sum of the radii: where the axes cross, the shortest way out is
    /// along their common normal.
    pub fn distance(&self, other: &Self) -> CapsuleDistance {
        let [s, t] = nearest(&self.ends, &other.ends);
        let between = point(&self.ends, s) - point(&other.ends, t);
        let apart = between.norm();
        let normal = if apart > TOUCHING_M {
            between / apart
        } else {
            across(&axis(&self.ends), &axis(&other.ends))
        };
        CapsuleDistance {
            distance_m: apart - self.radius_m - other.radius_m,
            by_first: [normal * (1.0 - s), normal * s],
            by_second: [normal * (t - 1.0), normal * -t],
        }
    }

    /// Distance to a box. Inside the box, the depth is measured to the nearest face.
    pub fn distance_to_box(&self, other: &OrientedBox) -> BoxDistance {
        let box_from_world = other.world_from_box.transpose();
        let ends = self.ends.map(|end| box_from_world * (end - other.center));
        let (s, apart, normal) = lowest(&ends, &other.half_size_m);
        let normal = other.world_from_box * normal;
        let arm = point(&self.ends, s) - other.center;
        BoxDistance {
            distance_m: apart - self.radius_m,
            by_ends: [normal * (1.0 - s), normal * s],
            by_center: -normal,
            by_rotation: normal.cross(&arm),
        }
    }

    /// Height of the lowest point above the plane z = 0, m, and its gradient with respect to the ends.
    pub fn height(&self) -> (f64, [Vector3<f64>; 2]) {
        let [from, to] = self.ends.map(|end| end.z);
        let (lowest, share) = if from <= to { (from, 0.0) } else { (to, 1.0) };
        (lowest - self.radius_m, [Vector3::z() * (1.0 - share), Vector3::z() * share])
    }
}

impl OrientedBox {
    /// Box of a link with the pose `origin` and `world_from_link`; `None` for a capsule.
    pub fn of(
        shape: &Shape,
        origin: &Vector3<f64>,
        world_from_link: &Matrix3<f64>,
    ) -> Option<Self> {
        let Shape::Box { center_in_link_m, size_m } = shape else { return None };
        let center = origin + world_from_link * center_in_link_m;
        Some(Self { center, world_from_box: *world_from_link, half_size_m: size_m * 0.5 })
    }

    /// Corners, in the order of binary numbers whose lowest digit selects the side along x.
    pub fn corners(&self) -> [Vector3<f64>; 8] {
        std::array::from_fn(|k| {
            let sign = Vector3::from_fn(|axis, _| if k >> axis & 1 == 0 { -1.0 } else { 1.0 });
            self.center + self.world_from_box * self.half_size_m.component_mul(&sign)
        })
    }

    /// Edges, each with its two ends.
    pub fn edges(&self) -> [[Vector3<f64>; 2]; 12] {
        let corners = self.corners();
        let mut ends = (0..8usize)
            .flat_map(|k| (0..3).map(move |axis| (k, k | 1 << axis)))
            .filter(|(from, to)| from != to);
        std::array::from_fn(|_| {
            let (from, to) = ends.next().expect("a box has 12 edges");
            [corners[from], corners[to]]
        })
    }

    /// Lower bound of the distance to a capsule, m: the largest distance from the plane of a face to the nearer end of the
    /// capsule's segment, minus the radius.
    pub fn least_distance(&self, capsule: &Capsule) -> f64 {
        let [from, to] = capsule.ends.map(|end| self.world_from_box.tr_mul(&(end - self.center)));
        let beyond = |k: usize| from[k].min(to[k]).max(-from[k].max(to[k])) - self.half_size_m[k];
        (0..3).map(beyond).fold(f64::NEG_INFINITY, f64::max) - capsule.radius_m
    }

    /// Height of the lowest corner above the plane z = 0, m, and its gradients with respect to the centre and to a rotation
    /// about the centre, in world axes.
    pub fn height(&self) -> (f64, [Vector3<f64>; 2]) {
        let toward = self.world_from_box.row(2).map(|z| if z > 0.0 { -1.0 } else { 1.0 });
        let corner = self.half_size_m.component_mul(&toward.transpose());
        let arm = self.world_from_box * corner;
        (self.center.z + arm.z, [Vector3::z(), arm.cross(&Vector3::z())])
    }
}

fn axis(ends: &[Vector3<f64>; 2]) -> Vector3<f64> {
    ends[1] - ends[0]
}

fn point(ends: &[Vector3<f64>; 2], s: f64) -> Vector3<f64> {
    ends[0] + axis(ends) * s
}

/// Unit vector perpendicular to two axes; perpendicular to the first axis if they are parallel.
fn across(first: &Vector3<f64>, second: &Vector3<f64>) -> Vector3<f64> {
    let thinnest = Vector3::ith(first.iamin(), 1.0);
    let candidates = [first.cross(second), first.cross(&thinnest), thinnest];
    let unit = |v: &Vector3<f64>| v.try_normalize(TOUCHING_M);
    candidates.iter().find_map(unit).unwrap_or_else(Vector3::z)
}

/// Parameters of the nearest points of two line segments, 0 to 1 (Ericson, Real-Time Collision Detection, sec. 5.1.9).
fn nearest(first: &[Vector3<f64>; 2], second: &[Vector3<f64>; 2]) -> [f64; 2] {
    let (u, v) = (axis(first), axis(second));
    let between = first[0] - second[0];
    let (a, b, e) = (u.norm_squared(), u.dot(&v), v.norm_squared());
    let (c, f) = (u.dot(&between), v.dot(&between));
    // If a segment is a point, any parameter is right.
    let on_first = |t: f64| if a > 0.0 { ((b * t - c) / a).clamp(0.0, 1.0) } else { 0.0 };
    let on_second = |s: f64| if e > 0.0 { (b * s + f) / e } else { 0.0 };
    let determinant = a * e - b * b;
    // On parallel segments, all points between the ends are nearest.
    let parallel = determinant <= 1e-14 * a * e;
    let s = if parallel { 0.0 } else { ((b * f - c * e) / determinant).clamp(0.0, 1.0) };
    let t = on_second(s);
    if (0.0..=1.0).contains(&t) && !parallel {
        return [s, t];
    }
    let t = t.clamp(0.0, 1.0);
    [on_first(t), t]
}

/// Distance of a point from the surface of a box, and its gradient; negative inside. `point` is in the frame of the box. The
/// distance is a convex function of the point.
fn signed_distance(point: &Vector3<f64>, half_size_m: &Vector3<f64>) -> (f64, Vector3<f64>) {
    let beyond = point.abs() - half_size_m;
    let outside = beyond.map(|d| d.max(0.0));
    let apart = outside.norm();
    if apart > TOUCHING_M {
        return (apart, outside.component_mul(&point.map(f64::signum)) / apart);
    }
    let face = beyond.imax();
    (beyond[face], Vector3::ith(face, 1.0f64.copysign(point[face])))
}

/// Point of a line segment that is nearest to a box or deepest in it: its parameter, its distance, and the gradient with
/// respect to this point.
///
/// Along the segment, the distance is convex. The Illinois method finds the zero of its slope. Inside the box, the zero may lie
/// between two faces, one approaching and one receding. The gradient is then the average of both normals for which the slope is
/// 0.
fn lowest(ends: &[Vector3<f64>; 2], half_size_m: &Vector3<f64>) -> (f64, f64, Vector3<f64>) {
    let along = axis(ends);
    let at = |s: f64| {
        let (apart, normal) = signed_distance(&point(ends, s), half_size_m);
        (s, apart, normal, normal.dot(&along))
    };
    let (mut falls, mut rises) = (at(0.0), at(1.0));
    if falls.3 >= 0.0 {
        return (falls.0, falls.1, falls.2);
    }
    if rises.3 <= 0.0 {
        return (rises.0, rises.1, rises.2);
    }
    // Slopes of the secant (Illinois method): the slope at an end that stays is halved.
    let (mut down, mut up) = (falls.3, rises.3);
    let mut last_fell = None;
    for _ in 0..STEPS {
        let width = rises.0 - falls.0;
        if -falls.3 * width < ROUNDING_M || rises.3 * width < ROUNDING_M {
            break;
        }
        let middle = at(falls.0 - width * down / (up - down));
        let fell = middle.3 < 0.0;
        let again = last_fell.replace(fell) == Some(fell);
        if fell {
            (falls, down) = (middle, middle.3);
            up *= if again { 0.5 } else { 1.0 };
        } else {
            (rises, up) = (middle, middle.3);
            down *= if again { 0.5 } else { 1.0 };
        }
    }
    let share = -falls.3 / (rises.3 - falls.3);
    let s = falls.0 + share * (rises.0 - falls.0);
    (s, falls.1.min(rises.1), falls.2.lerp(&rises.2, share))
}
