//! Shapes for clearance from collision geometry: capsules, and boxes of the body.
//!
//! A solid becomes the capsule of its length and cross-section, or the sphere of its volume if it is not longer than wide.
//! Boxes of the body stay boxes.

use super::bodies::Bodies;
use super::model::{Link, Solid, Urdf};
use super::names::some_names;
use super::notes::Notes;
use super::stance::{self, Tip};
use crate::file::parts::MassProperties;
use crate::shape::Shape;
use nalgebra::{Isometry3, Point3, Rotation3, UnitQuaternion, Vector3};
use std::collections::HashSet;
use std::f64::consts::PI;

/// Size below which a solid is a placeholder, m.
const PLACEHOLDER_M: f64 = 0.005;
/// Maximum number of shapes of a body in robot files.
const SHAPES_MAX: usize = 16;
/// Largest distance of a shape that is part of a foot or wheel from its surface, as a fraction of its radius.
const PART_OF_TIP: f64 = 0.1;
/// Largest height above the ground of a shape that touches the ground beside a foot or wheel, as a fraction of the radius of
/// that foot or wheel.
const GROUND_SHARE: f64 = 0.1;
/// Smallest depth of the top of a foot's sole below the body's joint, as a fraction of the depth of the ground.
const SOLE_SHARE: f64 = 0.5;
/// Height above the ground of a guessed shape that is shortened, as a fraction of the height of its top.
const BODY_ROOM: f64 = 0.1;
/// Largest plausible size of the box of an inertia, as a multiple of the robot's size.
const BOX_MAX: f64 = 5.0;
/// Largest radius of a capsule in robot files, m.
const RADIUS_MAX_M: f64 = 1.0;
/// Reciprocal cosine of the largest lean of a leg, 60°, at which its foot still touches the ground first.
const LEAN: f64 = 2.0;

/// Shapes of all bodies. Notes the meshes that a box replaces. `poses` are those of the nominal pose in the frame of the root.
pub(super) fn shapes(
    urdf: &Urdf,
    bodies: &Bodies,
    wheels: &HashSet<String>,
    tips: &[Tip],
    poses: &[Isometry3<f64>],
    notes: &mut Notes<'_>,
) -> Vec<Vec<Shape>> {
    let down: Vec<_> = poses.iter().map(|pose| pose.rotation.inverse() * -Vector3::z()).collect();
    let ground_m = tips.iter().map(|tip| stance::at(poses, tip).z - tip.radius_m);
    let ground_m = ground_m.reduce(f64::min).unwrap_or(f64::NEG_INFINITY);
    let robot_m = bodies.size_m();
    // A robot with one link has no size.
    let largest_m = if robot_m > 0.0 { BOX_MAX * robot_m } else { f64::INFINITY };
    let (mut meshes, mut shapeless) = (Vec::new(), Vec::new());
    let all = bodies.bodies.iter().enumerate().map(|(index, body)| {
        let tips: Vec<_> = tips.iter().filter(|tip| tip.body == index).collect();
        let mut shapes = Vec::new();
        for link in body.links.iter().map(|&link| (link, &urdf.links[link])) {
            let (link, Some((_, body_from_link))) = (link.1, &bodies.places[link.0]) else {
                continue;
            };
            // The shape of a wheel is its end effector.
            if wheels.contains(&link.name) {
                continue;
            }
            let solids = of_solids(link, body_from_link, index == 0);
            let on_foot =
                |shape| tips.iter().try_fold(shape, |shape, tip| trimmed(shape, tip, &down[index]));
            shapes.extend(solids.filter_map(on_foot));
            if link.shapes.iter().any(|shape| shape.collision && shape.solid == Solid::Mesh) {
                let guess = of_inertia(link, body_from_link, index == 0, largest_m);
                if guess.is_none() {
                    shapeless.push(link);
                }
                let guess = guess
                    .and_then(|shape| tips.iter().try_fold(shape, |shape, tip| behind(shape, tip)));
                shapes.extend(guess.and_then(|shape| above(shape, &poses[index], ground_m)));
                meshes.push(link);
            }
        }
        thinned(shapes, &tips)
    });
    let all = all.collect();
    if let Some(first) = meshes.first() {
        let names = some_names(meshes.iter().map(|link| &link.name));
        notes.warn(&first.span, format_args!("link {names}: the import does not read collision meshes, and replaces each by a box with the mass and inertia of the link; check `shapes` in the robot file"));
    }
    if let Some(first) = shapeless.first() {
        let names = some_names(shapeless.iter().map(|link| &link.name));
        notes.warn(&first.span, format_args!("link {names}: no shape, because the inertia is missing or far too large for the robot; correct <inertial>, or give `shapes` in the robot file"));
    }
    all
}

/// Shapes of the solids of a link.
fn of_solids(
    link: &Link,
    body_from_link: &Isometry3<f64>,
    root: bool,
) -> impl Iterator<Item = Shape> {
    let collision = link.shapes.iter().filter(|shape| shape.collision);
    collision.filter_map(move |shape| {
        let pose = body_from_link * shape.link_from_shape;
        match shape.solid {
            Solid::Sphere { radius_m } => Some(capsule(&pose, &Vector3::zeros(), radius_m)),
            Solid::Cylinder { radius_m, length_m } => {
                let volume_m3 = PI * radius_m.powi(2) * length_m;
                Some(rod(&pose, 2, length_m, radius_m, volume_m3))
            }
            Solid::Box { size_m } => cuboid(&pose, size_m, root),
            Solid::Mesh => None,
        }
    })
}

/// Drops a shape that is the sole of a foot, and keeps the part of a shank above its foot. `down` is the vertical in the body.
fn trimmed(shape: Shape, tip: &Tip, down: &Vector3<f64>) -> Option<Shape> {
    let Shape::Capsule { from_in_link_m, to_in_link_m, radius_m } = shape else {
        return Some(shape);
    };
    let ground_m = tip.center_m.dot(down) + tip.radius_m;
    let ends = [from_in_link_m, to_in_link_m].map(|end| end.dot(down));
    let [high, low] = [ends[0].min(ends[1]) - radius_m, ends[0].max(ends[1]) + radius_m];
    if ground_m <= 0.0 || low < ground_m - GROUND_SHARE * tip.radius_m {
        return Some(shape);
    }
    let lies = (ends[1] - ends[0]).abs() < radius_m;
    let is_sole = lies || high > SOLE_SHARE * ground_m;
    if is_sole { None } else { behind(shape, tip) }
}

/// Shape of a link with a mesh, from its inertia.
fn of_inertia(
    link: &Link,
    body_from_link: &Isometry3<f64>,
    root: bool,
    largest_m: f64,
) -> Option<Shape> {
    let (link_from_box, size_m) = inertia_box(link.mass.as_ref()?)?;
    if size_m.max() > largest_m {
        return None;
    }
    let shape = cuboid(&(body_from_link * link_from_box), size_m, root);
    shape.filter(
        |shape| !matches!(shape, Shape::Capsule { radius_m, .. } if *radius_m > RADIUS_MAX_M),
    )
}

/// Keeps the part of a guessed shape between the joint of its body, at the origin, and a foot or wheel, which then touches the
/// ground first. Returns `None` for a shape at the foot or beyond it.
fn behind(shape: Shape, tip: &Tip) -> Option<Shape> {
    let Shape::Capsule { from_in_link_m, to_in_link_m, radius_m } = shape else {
        return Some(shape);
    };
    let mut ends = [from_in_link_m, to_in_link_m];
    let along_limb = |end: &Vector3<f64>| end.dot(&tip.center_m);
    ends.sort_by(|a, b| along_limb(a).total_cmp(&along_limb(b)));
    let [far, near] = ends;
    if tip.center_m.norm() > tip.radius_m && along_limb(&far) > tip.center_m.norm_squared() {
        return None;
    }
    let above_m = (far - tip.center_m).norm();
    if above_m <= tip.radius_m {
        return None;
    }
    let radius_m = radius_m.min(tip.radius_m + above_m / LEAN);
    let along = (near - far).try_normalize(1e-9).unwrap_or_default();
    let to_tip = tip.center_m - far;
    let (way_m, aside_m) = (to_tip.dot(&along), to_tip.cross(&along).norm());
    // A shank as thick as its foot must also stay above the ground.
    let room_m = (LEAN * (radius_m - tip.radius_m + aside_m)).max(GROUND_SHARE * tip.radius_m);
    let length_m = (near - far).norm().min((way_m - room_m).max(0.0));
    let to_in_link_m = far + along * length_m;
    Some(Shape::Capsule { from_in_link_m: far, to_in_link_m, radius_m })
}

/// Shortens a guessed shape that reaches into the ground in the nominal pose. Returns `None` for a shape below the ground.
fn above(shape: Shape, pose: &Isometry3<f64>, ground_m: f64) -> Option<Shape> {
    let room_m = |top_m: f64| BODY_ROOM * (top_m - ground_m);
    match shape {
        Shape::Box { mut center_in_link_m, mut size_m } => {
            let [bottom_m, top_m] = [-0.5, 0.5].map(|of| center_in_link_m.z + of * size_m.z);
            if bottom_m < ground_m {
                let bottom_m = ground_m + room_m(top_m);
                (center_in_link_m.z, size_m.z) = (0.5 * (top_m + bottom_m), top_m - bottom_m);
            }
            (size_m.z > 0.0).then_some(Shape::Box { center_in_link_m, size_m })
        }
        Shape::Capsule { from_in_link_m, to_in_link_m, radius_m } => {
            let height_m = |end: &Vector3<f64>| (pose * Point3::from(*end)).z;
            let mut ends = [from_in_link_m, to_in_link_m];
            ends.sort_by(|a, b| height_m(a).total_cmp(&height_m(b)));
            let [low, high] = ends;
            let [low_m, high_m] = ends.each_ref().map(height_m);
            if low_m - radius_m >= ground_m {
                return Some(shape);
            }
            let least_m = ground_m + room_m(high_m + radius_m) + radius_m;
            let kept = (high_m - least_m) / (high_m - low_m);
            let to_in_link_m = high + (low - high) * kept;
            (kept > 0.0).then_some(Shape::Capsule { from_in_link_m: high, to_in_link_m, radius_m })
        }
    }
}

/// Capsule with ends at ± `half` in the frame of `pose`.
fn capsule(pose: &Isometry3<f64>, half: &Vector3<f64>, radius_m: f64) -> Shape {
    let end = |sign: f64| (pose * Point3::from(half * sign)).coords;
    Shape::Capsule { from_in_link_m: end(-1.0), to_in_link_m: end(1.0), radius_m }
}

fn cuboid(pose: &Isometry3<f64>, size_m: Vector3<f64>, root: bool) -> Option<Shape> {
    if size_m.max() < PLACEHOLDER_M {
        return None;
    }
    if root {
        // Bounding box along the axes of the body.
        let size_m = pose.rotation.to_rotation_matrix().matrix().abs() * size_m;
        return Some(Shape::Box { center_in_link_m: pose.translation.vector, size_m });
    }
    let longest = size_m.imax();
    let mut across = size_m;
    across[longest] = 0.0;
    Some(rod(pose, longest, size_m[longest], 0.5 * across.norm(), size_m.product()))
}

/// Solid along an axis of `pose`, with the radius of its cross-section.
fn rod(pose: &Isometry3<f64>, axis: usize, length_m: f64, radius_m: f64, volume_m3: f64) -> Shape {
    let half_m = 0.5 * length_m - radius_m;
    if half_m > 0.0 {
        capsule(pose, &Vector3::ith(axis, half_m), radius_m)
    } else {
        capsule(pose, &Vector3::zeros(), (0.75 * volume_m3 / PI).cbrt())
    }
}

/// Homogeneous box with the mass and inertia of a link: pose in the link, and size.
fn inertia_box(mass: &MassProperties) -> Option<(Isometry3<f64>, Vector3<f64>)> {
    let eigen = mass.inertia_kg_m2.symmetric_eigen();
    let moments = eigen.eigenvalues;
    let square = |axis: usize| 6.0 * (moments.sum() - 2.0 * moments[axis]) / mass.mass_kg;
    let size_m = Vector3::from_fn(|axis, _| square(axis).max(0.0).sqrt());
    let mut axes = eigen.eigenvectors;
    if axes.determinant() < 0.0 {
        axes.column_mut(0).neg_mut();
    }
    let turn = UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(axes));
    (size_m.max() > 0.0).then(|| (Isometry3::from_parts(mass.com_m.into(), turn), size_m))
}

/// Drops shapes inside another one or part of a foot or wheel, and the smallest of too many.
fn thinned(mut shapes: Vec<Shape>, tips: &[&Tip]) -> Vec<Shape> {
    let size = |shape: &Shape| match shape {
        Shape::Capsule { radius_m, .. } => *radius_m,
        Shape::Box { size_m, .. } => size_m.max(),
    };
    shapes.sort_by(|a, b| size(b).total_cmp(&size(a)));
    let mut kept: Vec<Shape> = Vec::new();
    for shape in shapes {
        let foot = |tip: &&Tip| {
            let ends = [tip.center_m; 2];
            within(&shape, &ends, tip.radius_m * (1.0 + PART_OF_TIP))
        };
        let inside = |other: &Shape| match other {
            Shape::Capsule { from_in_link_m, to_in_link_m, radius_m } => {
                within(&shape, &[*from_in_link_m, *to_in_link_m], *radius_m)
            }
            Shape::Box { .. } => shape == *other,
        };
        if kept.len() < SHAPES_MAX && !tips.iter().any(foot) && !kept.iter().any(inside) {
            kept.push(shape);
        }
    }
    kept
}

/// True if a shape is a capsule inside another one.
fn within(shape: &Shape, ends: &[Vector3<f64>; 2], radius_m: f64) -> bool {
    let Shape::Capsule { from_in_link_m, to_in_link_m, radius_m: own_m } = shape else {
        return false;
    };
    let along = ends[1] - ends[0];
    let far = |point: &Vector3<f64>| {
        let s = (point - ends[0]).dot(&along) / along.norm_squared().max(f64::MIN_POSITIVE);
        (point - ends[0] - along * s.clamp(0.0, 1.0)).norm()
    };
    far(from_in_link_m).max(far(to_in_link_m)) + own_m <= radius_m + 1e-9
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Matrix3;

    #[test]
    fn the_box_of_a_box_is_that_box() {
        let size = Vector3::new(0.3, 0.2, 0.1);
        let squares = size.component_mul(&size);
        let moments = (Vector3::repeat(squares.sum()) - squares) * (5.0 / 12.0);
        let turn = Rotation3::new(Vector3::new(0.3, -0.8, 0.5));
        let inertia_kg_m2 = turn * Matrix3::from_diagonal(&moments) * turn.inverse();
        let com_m = Vector3::new(0.1, 0.2, 0.3);
        let (pose, found) =
            inertia_box(&MassProperties { mass_kg: 5.0, com_m, inertia_kg_m2 }).unwrap();
        assert_eq!(pose.translation.vector, com_m);
        let mut sorted: Vec<_> = found.iter().copied().collect();
        sorted.sort_by(f64::total_cmp);
        for (found, expected) in sorted.iter().zip([0.1, 0.2, 0.3]) {
            assert!((found - expected).abs() < 1e-12, "{found} {expected}");
        }
        let longest = pose.rotation * Vector3::ith(found.imax(), 1.0);
        assert!((turn * Vector3::x()).cross(&longest).norm() < 1e-12);
    }

    #[test]
    fn a_guessed_shin_ends_above_its_foot() {
        let line = |from: f64, to: f64, radius_m| Shape::Capsule {
            from_in_link_m: Vector3::new(0.01, 0.0, from),
            to_in_link_m: Vector3::new(0.01, 0.0, to),
            radius_m,
        };
        let tip = Tip {
            body: 1,
            center_m: Vector3::new(0.0, 0.0, -0.2),
            radius_m: 0.02,
            body_from_level: None,
        };
        // The shin leans by 60° to each side, and its foot touches first.
        for (from, to) in [(0.0, -0.23), (-0.23, 0.0)] {
            let shin = behind(line(from, to, 0.025), &tip).unwrap();
            assert_eq!(shin, line(0.0, -0.17, 0.025));
            let Shape::Capsule { from_in_link_m, to_in_link_m, radius_m } = shin else { panic!() };
            for lean in [-1.04, -0.5, 0.0, 0.5, 1.04] {
                let turn = Rotation3::from_axis_angle(&Vector3::y_axis(), lean);
                let lowest = |point: Vector3<f64>, radius_m: f64| (turn * point).z - radius_m;
                let foot = lowest(tip.center_m, tip.radius_m);
                let ends = [from_in_link_m, to_in_link_m];
                assert!(ends.iter().all(|end| lowest(*end, radius_m) >= foot), "{lean}");
            }
        }
        // A shape that is too thick for its height gets thinner.
        let Some(Shape::Capsule { radius_m, .. }) = behind(line(-0.15, -0.15, 0.08), &tip) else {
            panic!()
        };
        assert!((radius_m - 0.02 - 0.5 * 0.05_f64.hypot(0.01)).abs() < 1e-12, "{radius_m}");
        // A shape that ends above its foot stays; a shape at the foot is removed.
        assert_eq!(behind(line(0.0, -0.1, 0.025), &tip), Some(line(0.0, -0.1, 0.025)));
        assert_eq!(behind(line(-0.2, -0.21, 0.03), &tip), None);
    }

    #[test]
    fn guessed_shapes_end_above_the_ground() {
        let of = |from: f64, to: f64| Shape::Box {
            center_in_link_m: Vector3::new(0.1, 0.0, 0.5 * (from + to)),
            size_m: Vector3::new(0.3, 0.2, to - from),
        };
        let cut = |from: f64, to: f64, ground_m: f64| match above(
            of(from, to),
            &Isometry3::identity(),
            ground_m,
        ) {
            Some(Shape::Box { center_in_link_m, size_m }) => {
                let half_m = 0.5 * size_m.z;
                Some([center_in_link_m.z - half_m, center_in_link_m.z + half_m])
            }
            other => other.map(|_| [0.0; 2]),
        };
        let [bottom_m, top_m] = cut(-0.01, 0.19, -0.01).unwrap();
        assert!((bottom_m - 0.01).abs() < 1e-12 && (top_m - 0.19).abs() < 1e-12);
        let body = Isometry3::identity();
        assert_eq!(above(of(0.1, 0.2), &body, 0.0), Some(of(0.1, 0.2)));
        assert_eq!(cut(-0.2, -0.1, -0.05), None);
        // A robot without feet has no ground.
        assert_eq!(above(of(-0.2, 0.3), &body, f64::NEG_INFINITY), Some(of(-0.2, 0.3)));
        // A shank in a body that is turned by half a turn, so that it hangs from z = 0 to z = -0.42.
        let turn = UnitQuaternion::from_axis_angle(&Vector3::x_axis(), PI);
        let hanging = Isometry3::from_parts(Vector3::zeros().into(), turn);
        let line = |to: f64| Shape::Capsule {
            from_in_link_m: Vector3::new(0.0, 0.0, -0.05),
            to_in_link_m: Vector3::new(0.0, 0.0, to),
            radius_m: 0.02,
        };
        let Some(Shape::Capsule { to_in_link_m, .. }) = above(line(0.4), &hanging, -0.4) else {
            panic!()
        };
        assert!((to_in_link_m.z - (0.4 - 0.1 * 0.47 - 0.02)).abs() < 1e-12, "{to_in_link_m}");
        assert_eq!(above(line(0.37), &hanging, -0.4), Some(line(0.37)));
        assert_eq!(above(line(0.4), &hanging, 0.2), None);
    }

    #[test]
    fn small_shapes_inside_others_go() {
        let line = |from: f64, to: f64, radius_m| Shape::Capsule {
            from_in_link_m: Vector3::new(from, 0.0, 0.0),
            to_in_link_m: Vector3::new(to, 0.0, 0.0),
            radius_m,
        };
        let (long, inner, beside) =
            (line(0.0, 1.0, 0.1), line(0.2, 0.9, 0.05), line(0.9, 1.2, 0.05));
        let tip = Tip {
            body: 1,
            center_m: Vector3::new(3.0, 0.0, 0.0),
            radius_m: 0.02,
            body_from_level: None,
        };
        let foot = line(3.0, 3.0, 0.021);
        let kept = thinned(vec![inner, beside, long, foot], &[&tip]);
        assert_eq!(kept, [long, beside]);
    }
}
