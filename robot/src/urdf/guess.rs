//! Guesses about a URDF: joints to lock, wheels among continuous leaves, feet among leaf links. They go
//! into the template of the side file, for a person to check.

use super::bodies::{Bodies, Rigid, merge};
use super::convert::locked_position;
use super::model::{Joint, Kind, Link, Solid, Urdf};
use super::notes::Notes;
use super::stance::Tip;
use super::tree::{Graph, Tree};
use crate::rules::ITEMS_MAX;
use nalgebra::{Isometry3, Point3, Vector3};

/// Parts of names of links that stand on the ground.
const FEET: [&str; 8] = ["foot", "feet", "toe", "sole", "hoof", "paw", "tip", "contact"];
/// Parts of names of links that are wheels.
const WHEELS: [&str; 3] = ["wheel", "tire", "tyre"];
/// Radius of a foot whose URDF has no sphere, m.
const FOOT_RADIUS_M: f64 = 0.02;
/// Radius of a wheel whose URDF has neither cylinder nor sphere, m.
const WHEEL_RADIUS_M: f64 = 0.05;

/// A guessed foot or wheel.
#[derive(Debug)]
pub(super) struct End {
    /// The wheel's joint; none for a foot.
    pub axle: Option<usize>,
    /// The URDF link: foot or wheel.
    pub link: usize,
    /// Centre in that link.
    pub center_in_link_m: Vector3<f64>,
    pub radius_m: f64,
    /// True if the radius comes from the URDF.
    pub measured: bool,
    pub kind: EndKind,
    pub tip: Tip,
}

/// Kind of contact of a guessed foot or wheel.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum EndKind {
    Foot,
    DrivenWheel,
    FreeWheel,
    /// A wheel that is fixed to its link, with its axis in that.
    WeldedWheel(Vector3<f64>),
}

impl EndKind {
    /// Kind of contact as robot files spell it.
    pub fn contact(self) -> &'static str {
        match self {
            Self::Foot => "point_foot",
            Self::DrivenWheel => "actuated_wheel",
            Self::FreeWheel => "passive_wheel",
            Self::WeldedWheel(_) => "welded_wheel",
        }
    }
}

/// Joints of kinds that robot files do not have, with their locked position.
pub(super) fn locks(urdf: &Urdf, tree: &Tree) -> Vec<(usize, f64)> {
    let locked = |&index: &usize| {
        let joint = &urdf.joints[index];
        let limit = joint.limit;
        let stuck =
            joint.kind == Kind::Revolute && limit.lower.is_some() && limit.lower == limit.upper;
        let foreign = matches!(joint.kind, Kind::Prismatic | Kind::Planar | Kind::Floating);
        let drives = joint.mimics.is_some() && joint.kind != Kind::Fixed;
        (stuck || foreign || drives).then(|| (index, locked_position(joint)))
    };
    tree.order.iter().filter_map(locked).collect()
}

/// Axles of likely wheels, which are leaves about a horizontal axis: joints without limits whose link has a wheel's name,
/// a round shape about the axis, or its centre of mass on it; and with limits, links with a wheel's name and a
/// cylinder about the axis.
pub(super) fn axles(urdf: &Urdf, graph: &Graph, tree: &Tree, rigid: &Rigid) -> Vec<usize> {
    // Warnings belong to the import itself.
    let bodies = merge(urdf, graph, tree, rigid, &mut Notes::new("", ""));
    let leaf = |body: usize| !bodies.moving.iter().any(|moving| moving.parent == body);
    let mut straight = vec![Isometry3::identity(); bodies.bodies.len()];
    let mut axles = Vec::new();
    for moving in &bodies.moving {
        straight[moving.child] = straight[moving.parent] * moving.parent_from_joint;
        let joint = &urdf.joints[moving.joint];
        let axis = straight[moving.child].rotation * joint.axis.into_inner();
        if !leaf(moving.child) || axis.z.abs() > 0.5 {
            continue;
        }
        let body = &bodies.bodies[moving.child];
        let links = || body.links.iter().map(|&link| &urdf.links[link]);
        let named = links().any(|link| has(&link.name, &WHEELS));
        let called = named || has(&joint.name, &WHEELS);
        let round = links().next().is_some_and(|link| roundness(link, &joint.axis).is_some());
        let centred = body.mass.com_m.cross(&joint.axis).norm() < 0.005
            && links().any(|link| link.mass.is_some());
        let footed = links().any(|link| has(&link.name, &FEET));
        let endless = joint.kind == Kind::Continuous
            || joint.kind == Kind::Revolute
                && joint.limit.lower.is_none()
                && joint.limit.upper.is_none();
        // What turns without end and without a motor is no toe.
        let wheel_like = (round || centred) && (!footed || lacks_motor(urdf, joint));
        let wheel = if endless { called || wheel_like } else { named && round };
        if wheel {
            axles.push(moving.joint);
        }
    }
    axles
}

/// True if a joint has no motor in a file that has motors. A file without any does not describe motors.
pub(super) fn lacks_motor(urdf: &Urdf, joint: &Joint) -> bool {
    !joint.has_motor && urdf.joints.iter().any(|other| other.has_motor)
}

fn has(name: &str, words: &[&str]) -> bool {
    let name = name.to_ascii_lowercase();
    words.iter().any(|word| name.contains(word))
}

/// Radius of a shape about a wheel's axis, and its centre.
fn roundness(wheel: &Link, axis: &Vector3<f64>) -> Option<(f64, Vector3<f64>)> {
    wheel.shapes.iter().find_map(|shape| {
        let center = shape.link_from_shape.translation.vector;
        let radius_m = match shape.solid {
            Solid::Sphere { radius_m } => radius_m,
            Solid::Cylinder { radius_m, .. } => {
                let along = shape.link_from_shape.rotation * Vector3::z();
                (along.dot(axis).abs() > 0.95).then_some(radius_m)?
            }
            Solid::Box { .. } | Solid::Mesh => return None,
        };
        (center.cross(axis).norm() < 0.2 * radius_m).then_some((radius_m, center))
    })
}

/// Feet and wheels, in the order of limbs.
pub(super) fn ends(urdf: &Urdf, graph: &Graph, bodies: &Bodies, axles: &[usize]) -> Vec<End> {
    let mut ends = Vec::new();
    let named = urdf
        .links
        .iter()
        .enumerate()
        .any(|(index, link)| bodies.places[index].is_some() && has(&link.name, &FEET));
    for (index, body) in bodies.bodies.iter().enumerate() {
        let wheels = axles.iter().filter(|&&axle| body.links.contains(&graph.ends[axle].1));
        let before = ends.len();
        ends.extend(wheels.filter_map(|&axle| wheel(urdf, graph, bodies, axle)));
        let leaf = index > 0 && !bodies.moving.iter().any(|moving| moving.parent == index);
        if ends.len() > before || !leaf {
            continue;
        }
        let links = || body.links.iter().copied();
        let welded = links().find_map(|link| welded_wheel(urdf, bodies, link));
        if welded.is_some() {
            ends.extend(welded);
            continue;
        }
        let sphere = |link: &usize| {
            urdf.links[*link].shapes.iter().any(|shape| matches!(shape.solid, Solid::Sphere { .. }))
        };
        let called = |link: &usize| has(&urdf.links[*link].name, &FEET);
        let link = if named {
            links().find(|link| called(link) && sphere(link)).or_else(|| links().find(called))
        } else if axles.is_empty() {
            // The end of the leg: the last link fixed to it, a sphere if there is one.
            links().find(sphere).or_else(|| links().next_back())
        } else {
            None
        };
        ends.extend(link.and_then(|link| foot(urdf, bodies, link)));
    }
    // A robot file has no more.
    ends.truncate(ITEMS_MAX);
    ends
}

fn wheel(urdf: &Urdf, graph: &Graph, bodies: &Bodies, axle: usize) -> Option<End> {
    let link = graph.ends[axle].1;
    let joint = &urdf.joints[axle];
    let round = roundness(&urdf.links[link], &joint.axis);
    let (radius_m, center) = round.unwrap_or((WHEEL_RADIUS_M, Vector3::zeros()));
    let words = ["caster", "passive", "free"];
    let called = has(&joint.name, &words) || has(&urdf.links[link].name, &words);
    let kind =
        if called || lacks_motor(urdf, joint) { EndKind::FreeWheel } else { EndKind::DrivenWheel };
    end(bodies, link, Some(axle), center, radius_m, round.is_some(), kind)
}

/// A link with a wheel's name and a cylinder that no joint turns.
fn welded_wheel(urdf: &Urdf, bodies: &Bodies, link: usize) -> Option<End> {
    let wheel = &urdf.links[link];
    let (radius_m, pose) = wheel.shapes.iter().find_map(|shape| match shape.solid {
        Solid::Cylinder { radius_m, .. } => Some((radius_m, shape.link_from_shape)),
        _ => None,
    })?;
    let kind = EndKind::WeldedWheel(pose.rotation * Vector3::z());
    has(&wheel.name, &WHEELS)
        .then(|| end(bodies, link, None, pose.translation.vector, radius_m, true, kind))?
}

fn foot(urdf: &Urdf, bodies: &Bodies, link: usize) -> Option<End> {
    let sphere = urdf.links[link].shapes.iter().find_map(|shape| match shape.solid {
        Solid::Sphere { radius_m } => Some((radius_m, shape.link_from_shape.translation.vector)),
        _ => None,
    });
    let (radius_m, center) = sphere.unwrap_or((FOOT_RADIUS_M, Vector3::zeros()));
    end(bodies, link, None, center, radius_m, sphere.is_some(), EndKind::Foot)
}

fn end(
    bodies: &Bodies,
    link: usize,
    axle: Option<usize>,
    center_in_link_m: Vector3<f64>,
    radius_m: f64,
    measured: bool,
    kind: EndKind,
) -> Option<End> {
    let (body, body_from_link) = bodies.places[link]?;
    let center_m = (body_from_link * Point3::from(center_in_link_m)).coords;
    let tip = Tip { body, center_m, radius_m };
    Some(End { axle, link, center_in_link_m, radius_m, measured, kind, tip })
}
