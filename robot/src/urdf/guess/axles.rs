//! Axles of wheels: joints at the ends of limbs, about a horizontal axis, around which their body is round. A joint with limits
//! is an axle only if its name or the name of its link contains a word of `WHEELS`.

use super::super::bodies::{Body, Rigid, merge};
use super::super::model::{Joint, Link, Shape, Solid, Urdf};
use super::super::notes::Notes;
use super::super::tree::{Graph, Tree};
use super::has;
use nalgebra::{Isometry3, Unit, Vector3};

/// Parts of names of wheels.
pub(super) const WHEELS: [&str; 4] = ["wheel", "tire", "tyre", "whl"];
/// Largest vertical component of an axle.
pub(super) const UPRIGHT: f64 = 0.7;
/// Largest distance of a wheel's centre of mass from its axle, as a fraction of the radius of gyration.
const CENTRED: f64 = 0.3;
/// Largest distance of a wheel's round shape from its axle, as a fraction of the radius of the shape.
const ABOUT_AXLE: f64 = 0.2;
/// Smallest cosine of the angle between the axle and a cylinder along it.
const ALONG: f64 = 0.95;
/// Radius of a wheel without shape and inertia, as a fraction of the robot's size.
const RADIUS_SHARE: f64 = 0.1;

/// Disc that stands for a wheel.
pub(super) struct Disc {
    pub center_m: Vector3<f64>,
    pub radius_m: f64,
    /// True if the radius comes from a shape.
    pub measured: bool,
}

/// Cylinder of a wheel that lies across its axle.
pub struct Across {
    pub joint: usize,
    pub link: usize,
    pub radius_m: f64,
}

/// Axles of likely wheels. `rigid` has the locked joints, and `up` is in the frame of the root.
pub fn axles(
    urdf: &Urdf,
    graph: &Graph,
    tree: &Tree,
    rigid: &Rigid,
    up: &Vector3<f64>,
) -> Vec<usize> {
    // Warnings are part of the import.
    let bodies = merge(urdf, graph, tree, rigid, &mut Notes::new("", ""));
    let children = bodies.children();
    let mut straight = vec![Isometry3::identity(); bodies.bodies.len()];
    let mut axles = Vec::new();
    for moving in &bodies.moving {
        straight[moving.child] = straight[moving.parent] * moving.parent_from_joint;
        let joint = &urdf.joints[moving.joint];
        let axis = straight[moving.child].rotation * joint.axis.into_inner();
        let is_axis = children[moving.child] == 0 && axis.dot(up).abs() < UPRIGHT && joint.turns();
        let body = &bodies.bodies[moving.child];
        if is_axis && is_wheel(urdf, graph, moving.joint, joint, body) {
            axles.push(moving.joint);
        }
    }
    axles
}

/// True if a body at the end of a limb rolls about its joint.
fn is_wheel(urdf: &Urdf, graph: &Graph, index: usize, joint: &Joint, body: &Body) -> bool {
    let links = || body.links.iter().map(|&link| &urdf.links[link]);
    let called = has(&joint.name, &WHEELS) || links().any(|link| has(&link.name, &WHEELS));
    let shapes = placed_shapes(urdf, graph, index);
    let round = shapes.iter().any(|shape| about(shape, &joint.axis).is_some());
    if !joint.is_endless() {
        // Some exporters give limits to every joint.
        return called && round;
    }
    if let Some(outermost) = outermost(&shapes, &joint.axis) {
        return outermost;
    }
    let has_mass = links().any(|link| link.mass.is_some());
    let about_axis = joint.axis.dot(&(body.mass.inertia_kg_m2 * joint.axis.into_inner()));
    let gyration_m = (about_axis / body.mass.mass_kg).max(0.0).sqrt();
    let beside_m = body.mass.com_m.cross(&joint.axis).norm();
    // Some files give every link the same centre of mass, so the name decides if a mass is beside the axis.
    !has_mass || beside_m <= CENTRED * gyration_m || called && beside_m < gyration_m
}

/// True if the shape that is farthest from the axle is centred on it, as a tyre is and a shank is not. `None` without shapes.
fn outermost(shapes: &[Shape], axis: &Unit<Vector3<f64>>) -> Option<bool> {
    let collision = shapes.iter().any(|shape| shape.collision && half_size_m(shape).is_some());
    let farthest = shapes
        .iter()
        .filter(|shape| shape.collision == collision)
        .filter_map(|shape| {
            let half_m = half_size_m(shape)?;
            let beside_m = shape.link_from_shape.translation.vector.cross(axis).norm();
            Some((beside_m + half_m, beside_m <= 2.0 * ABOUT_AXLE * half_m))
        })
        .max_by(|one, other| one.0.total_cmp(&other.0))?;
    Some(farthest.1)
}

/// Half of the largest side of a solid, m; `None` for meshes.
fn half_size_m(shape: &Shape) -> Option<f64> {
    match shape.solid {
        Solid::Sphere { radius_m } => Some(radius_m),
        Solid::Cylinder { radius_m, length_m } => Some(radius_m.max(0.5 * length_m)),
        Solid::Box { size_m } => Some(0.5 * size_m.max()),
        Solid::Mesh => None,
    }
}

/// Shapes of all links that turn with an axle, in the frame of its child.
fn placed_shapes(urdf: &Urdf, graph: &Graph, axle: usize) -> Vec<Shape> {
    let mut shapes = Vec::new();
    let mut open = vec![(graph.ends[axle].1, Isometry3::identity())];
    while let Some((link, wheel_from_link)) = open.pop() {
        let of = |shape: &Shape| Shape {
            link_from_shape: wheel_from_link * shape.link_from_shape,
            ..shape.clone()
        };
        shapes.extend(urdf.links[link].shapes.iter().map(of));
        for &joint in &graph.leaving[link] {
            // Links that move behind an axle are locked in the template.
            let pose = wheel_from_link * urdf.joints[joint].parent_from_joint;
            open.push((graph.ends[joint].1, pose));
        }
    }
    shapes
}

/// Radius of a shape about an axis through the origin, m; `None` unless the shape is round about the axis.
fn about(shape: &Shape, axis: &Unit<Vector3<f64>>) -> Option<f64> {
    let radius_m = match shape.solid {
        Solid::Sphere { radius_m } => radius_m,
        Solid::Cylinder { radius_m, .. } => {
            let along = shape.link_from_shape.rotation * Vector3::z();
            (along.dot(axis).abs() > ALONG).then_some(radius_m)?
        }
        Solid::Box { .. } | Solid::Mesh => return None,
    };
    let beside_m = shape.link_from_shape.translation.vector.cross(axis).norm();
    (beside_m < ABOUT_AXLE * radius_m).then_some(radius_m)
}

/// Disc of a wheel in the frame of its link: the outermost round shape that turns with the axle, or otherwise the disc with
/// the wheel's inertia.
pub(super) fn disc(urdf: &Urdf, graph: &Graph, axle: usize, size_m: f64) -> Disc {
    let axis = &urdf.joints[axle].axis;
    let shapes = placed_shapes(urdf, graph, axle);
    let round = shapes.iter().filter_map(|shape| {
        Some((about(shape, axis)?, shape.collision, shape.link_from_shape.translation.vector))
    });
    // A visual tyre around a collision hub counts as the tyre.
    if let Some((radius_m, _, center_m)) = round.max_by(|a, b| a.0.total_cmp(&b.0)) {
        return Disc { center_m, radius_m, measured: true };
    }
    if let Some(across) = across(urdf, graph, axle) {
        let center_m = Vector3::zeros();
        return Disc { center_m, radius_m: across.radius_m, measured: true };
    }
    // A disc has m r² / 2.
    let link = &urdf.links[graph.ends[axle].1];
    let inertia_m = |link: &Link| {
        let mass = link.mass?;
        let moment = axis.dot(&(mass.inertia_kg_m2 * axis.into_inner()));
        Some((2.0 * moment / mass.mass_kg).max(0.0).sqrt())
    };
    let plausible = |radius_m: &f64| (0.1..=3.0).contains(&(radius_m / (RADIUS_SHARE * size_m)));
    let radius_m = inertia_m(link).filter(plausible).unwrap_or(RADIUS_SHARE * size_m);
    let beside = link.mass.map_or(0.0, |mass| mass.com_m.dot(axis));
    Disc { center_m: axis.into_inner() * beside, radius_m, measured: false }
}

/// Cylinder around the axle's origin that lies across the axle, if no shape is round about it.
pub fn across(urdf: &Urdf, graph: &Graph, axle: usize) -> Option<Across> {
    let axis = &urdf.joints[axle].axis;
    let shapes = placed_shapes(urdf, graph, axle);
    if shapes.iter().any(|shape| about(shape, axis).is_some()) {
        return None;
    }
    let flat = shapes.iter().filter_map(|shape| match shape.solid {
        Solid::Cylinder { radius_m, .. } => Some(radius_m),
        _ => None,
    });
    let radius_m = flat.max_by(f64::total_cmp)?;
    Some(Across { joint: axle, link: graph.ends[axle].1, radius_m })
}
