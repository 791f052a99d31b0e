//! Contact of the last body of a limb: its lowest sphere, capsule or box along the limb, else the end of the limb by its mass.

use super::super::bodies::Bodies;
use super::super::model::{Shape, Solid, Urdf};
use super::super::stance::{self, Turn};
use super::{End, EndKind, end};
use nalgebra::{Isometry3, Point3, Unit, Vector3};

/// Radius of a foot without a shape, as a fraction of the length from the root to its end.
const RADIUS_SHARE: f64 = 0.05;
/// Distance behind the end of the limb within which shapes touch the ground together, as a fraction of the limb's length.
const TOGETHER: f64 = 0.03;
/// Largest distance of a contact on the last axis from this axis, as a fraction of the limb's length.
const ON_AXIS: f64 = 0.02;
/// Smallest cosine of the angle between the vertical and a limb whose foot is below it.
const HANGING: f64 = 0.85;

/// Last body of a limb.
pub(super) struct Tail {
    pub body: usize,
    /// Bodies of the limb, the last one first.
    pub chain: Vec<usize>,
    /// Direction of the limb, in the body.
    along: Unit<Vector3<f64>>,
    /// Axis of the last joint, in the body, through its origin.
    axis: Unit<Vector3<f64>>,
    /// Vector from the joint before the last one, in the body.
    before_m: Vector3<f64>,
    pub length_m: f64,
    /// Length along all joints from the root, m.
    from_root_m: f64,
}

/// Sphere that touches the end of a shape, in the body.
#[derive(Clone, Copy)]
struct Pad {
    link: usize,
    center_m: Vector3<f64>,
    radius_m: f64,
    is_sphere: bool,
}

impl Pad {
    /// Distance of its end along a limb.
    fn reach_m(&self, along: &Vector3<f64>) -> f64 {
        self.center_m.dot(along) + self.radius_m
    }
}

/// Robot with all joints at the angles nearest to 0.
pub(super) struct Posed<'a> {
    pub urdf: &'a Urdf,
    pub bodies: &'a Bodies,
    pub turns: Vec<Turn>,
    pub poses: Vec<Isometry3<f64>>,
    /// Number of joints that leave each body.
    children: Vec<usize>,
    size_m: f64,
}

impl<'a> Posed<'a> {
    pub fn new(urdf: &'a Urdf, bodies: &'a Bodies, size_m: f64) -> Self {
        let turns = stance::turns(urdf, bodies);
        // In the home pose, a leg may be folded.
        let zero = stance::zero(&turns);
        let poses = stance::poses(bodies, turns.iter().map(|turn| &turn.axis), &zero);
        Self { urdf, bodies, turns, poses, children: bodies.children(), size_m }
    }
}

/// Contact at the end of a body without moving children.
pub(super) fn foot(posed: &Posed<'_>, body: usize) -> Option<(End, Tail)> {
    let bodies = posed.bodies;
    let tail = tail(posed, body)?;
    let beside_m = |at: &Vector3<f64>| at.cross(&tail.axis).norm();
    let on_axis_m = ON_AXIS * tail.length_m;
    let all: Vec<Pad> = solids(posed, body)
        .iter()
        .map(|(link, pose, shape)| pad(*link, pose, shape, &tail.along))
        .collect();
    let off_axis: Vec<_> =
        all.iter().copied().filter(|pad| beside_m(&pad.center_m) > on_axis_m).collect();
    let heavy_m = beside_m(&bodies.bodies[body].mass.com_m);
    // A sphere on the axis is the foot only if nothing extends beyond it.
    let pads = if off_axis.is_empty() && heavy_m <= on_axis_m { all } else { off_axis };
    let point = match lowest(&pads, &tail) {
        Some(pad) => at(bodies, pad.link, pad.center_m, pad.radius_m, true),
        None => {
            let (link, center_m) = unshaped(bodies, &tail, on_axis_m);
            at(bodies, link, center_m, RADIUS_SHARE * tail.from_root_m, false)
        }
    }?;
    Some((point, tail))
}

/// Shapes of a body with their links and poses: collision geometry, else visual geometry, without meshes.
pub(super) fn solids<'a>(
    posed: &Posed<'a>,
    body: usize,
) -> Vec<(usize, Isometry3<f64>, &'a Shape)> {
    let Posed { urdf, bodies, .. } = *posed;
    let shapes = bodies.bodies[body].links.iter().flat_map(|&link| {
        let pose = bodies.places[link].map(|(_, pose)| pose);
        urdf.links[link].shapes.iter().filter_map(move |shape| Some((link, pose?, shape)))
    });
    let solid = shapes.filter(|(.., shape)| shape.solid != Solid::Mesh);
    let (collision, visual): (Vec<_>, Vec<_>) = solid.partition(|(.., shape)| shape.collision);
    if collision.is_empty() { visual } else { collision }
}

/// Foot with its centre in the body.
pub(super) fn at(
    bodies: &Bodies,
    link: usize,
    center_m: Vector3<f64>,
    radius_m: f64,
    measured: bool,
) -> Option<End> {
    let (_, body_from_link) = bodies.places[link]?;
    let center_in_link_m = body_from_link.inverse_transform_point(&Point3::from(center_m)).coords;
    end(bodies, link, None, center_in_link_m, radius_m, measured, EndKind::Foot)
}

fn tail(posed: &Posed<'_>, body: usize) -> Option<Tail> {
    let Posed { urdf, bodies, poses, .. } = posed;
    let size_m = posed.size_m;
    let path: Vec<usize> =
        stance::chain(bodies, body).iter().rev().map(|&joint| bodies.moving[joint].child).collect();
    // A limb begins where other limbs branch off.
    let own = path.iter().skip(1).take_while(|&&body| posed.children[body] == 1).count();
    let chain = &path[..=own];
    let last = body.checked_sub(1)?;
    let origin = |body: usize| poses[body].translation.vector;
    let hip = origin(*chain.last()?);
    let of_body = &bodies.bodies[body];
    let centers = of_body.links.iter().filter_map(|&link| {
        let (_, pose) = bodies.places[link]?;
        let shapes = urdf.links[link].shapes.iter();
        let solid = shapes.filter(|shape| shape.solid != Solid::Mesh);
        Some(solid.map(move |shape| (pose * shape.link_from_shape).translation.vector))
    });
    let centers: Vec<_> = centers.flatten().collect();
    let middle = match centers.len() {
        0 => of_body.mass.com_m,
        count => centers.iter().sum::<Vector3<f64>>() / count as f64,
    };
    let middle = (poses[body] * Point3::from(middle)).coords;
    let down = -Vector3::z();
    let along = Unit::try_new(middle - hip, 1e-6 * size_m).unwrap_or(Unit::new_unchecked(down));
    let along = if along.dot(&down) > HANGING { Unit::new_unchecked(down) } else { along };
    let before = chain.get(1).copied().unwrap_or(bodies.moving[last].parent);
    let along_joints = |bodies: &[usize]| -> f64 {
        bodies.windows(2).map(|ends| (origin(ends[1]) - origin(ends[0])).norm()).sum()
    };
    // The first joint is at the body, independent of the body's frame.
    let end_m = (middle - origin(body)).norm();
    let from_root_m = along_joints(&path) + end_m;
    let turn = poses[body].rotation.inverse();
    Some(Tail {
        body,
        chain: chain.to_vec(),
        along: turn * along,
        axis: posed.turns[last].axis,
        before_m: turn * (origin(body) - origin(before)),
        from_root_m: from_root_m.max(0.05 * size_m),
        length_m: (along_joints(chain) + end_m).max(0.05 * size_m),
    })
}

/// Sphere inside the end of a shape along a limb.
fn pad(link: usize, pose: &Isometry3<f64>, shape: &Shape, along: &Vector3<f64>) -> Pad {
    let pose = pose * shape.link_from_shape;
    let center_m = pose.translation.vector;
    let axis = |index: usize| {
        let axis: Vector3<f64> = pose.rotation * Vector3::ith(index, 1.0);
        if axis.dot(along) < 0.0 { -axis } else { axis }
    };
    let (shift_m, radius_m) = match shape.solid {
        Solid::Sphere { radius_m } => (Vector3::zeros(), radius_m),
        Solid::Cylinder { radius_m, length_m } => {
            let (axis, half_m) = (axis(2), 0.5 * length_m);
            let lengthwise = axis.dot(along);
            if lengthwise < 0.3 {
                // A cylinder across the limb stands on its rim, like a wheel.
                (Vector3::zeros(), radius_m)
            } else {
                let radius_m = radius_m.min(half_m);
                (axis * (half_m - radius_m), radius_m)
            }
        }
        Solid::Box { size_m } => {
            let lengthwise = Vector3::from_fn(|index, _| axis(index).dot(along));
            let end = lengthwise.imax();
            let radius_m = 0.5 * size_m.min();
            (axis(end) * (0.5 * size_m[end] - radius_m), radius_m)
        }
        Solid::Mesh => (Vector3::zeros(), 0.0),
    };
    let is_sphere = matches!(shape.solid, Solid::Sphere { .. });
    Pad { link, center_m: center_m + shift_m, radius_m, is_sphere }
}

/// Contact sphere of a limb, in the middle of the pads at its end. Pads that are spheres have priority.
fn lowest(pads: &[Pad], tail: &Tail) -> Option<Pad> {
    let end_m = pads.iter().map(|pad| pad.reach_m(&tail.along)).reduce(f64::max)?;
    let near = |pad: &&Pad| pad.reach_m(&tail.along) > end_m - TOGETHER * tail.length_m;
    let mut standing: Vec<_> = pads.iter().filter(near).copied().collect();
    if standing.iter().any(|pad| pad.is_sphere) {
        standing.retain(|pad| pad.is_sphere);
    }
    let first = *standing.first()?;
    let end_m = standing.iter().map(|pad| pad.reach_m(&tail.along)).reduce(f64::max)?;
    let radius_m = standing.iter().map(|pad| pad.radius_m).reduce(f64::min)?;
    let sum: Vector3<f64> = standing.iter().map(|pad| pad.center_m).sum();
    let middle = sum / standing.len() as f64;
    let center_m = middle + tail.along.into_inner() * (end_m - radius_m - middle.dot(&tail.along));
    Some(Pad { radius_m, center_m, ..first })
}

/// Link and point of the end of a body without shapes: its farthest link, else the mirror image of the joint in the centre
/// of mass, else a body as long as the one before.
fn unshaped(bodies: &Bodies, tail: &Tail, on_axis_m: f64) -> (usize, Vector3<f64>) {
    let body = &bodies.bodies[tail.body];
    let com_m = body.mass.com_m;
    let beside_m = |at: &Vector3<f64>| at.cross(&tail.axis).norm();
    let origins = body
        .links
        .iter()
        .filter_map(|&link| bodies.places[link].map(|(_, pose)| (link, pose.translation.vector)));
    let farthest = origins.max_by(|a, b| beside_m(&a.1).total_cmp(&beside_m(&b.1)));
    match farthest {
        Some((link, at)) if beside_m(&at) > beside_m(&com_m).max(on_axis_m) => (link, at),
        _ if beside_m(&com_m) > 0.5 * on_axis_m => (body.links[0], com_m * 2.0),
        _ => (body.links[0], tail.along.into_inner() * tail.before_m.norm().max(on_axis_m)),
    }
}
