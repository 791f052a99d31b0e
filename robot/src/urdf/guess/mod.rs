//! Guesses about a URDF from its mechanics: joints to lock, wheels, feet, heading. They go into the template of the side file,
//! for a person to check.
//!
//! `axles` finds wheels among the joints at the ends of limbs, `soles` the contact of each other end, `corners` the corners of
//! its sole, and `ground` the ends that reach the ground together. `heading` finds the axes that point forward and up. No foot,
//! wheel or axis follows from a name alone.

mod axles;
mod casters;
mod corners;
mod ground;
mod heading;
mod soles;

pub(super) use axles::{across, axles};
pub(super) use corners::Corner;
pub(super) use heading::{Axes, Heading, forward, up};

use super::bodies::{Bodies, Rigid};
use super::model::{Joint, Kind, Solid, Urdf};
use super::stance::Tip;
use super::tree::{Graph, Tree};
use crate::rules::ITEMS_MAX;
use nalgebra::{Point3, Vector3};

/// Guessed foot or wheel.
#[derive(Debug)]
pub(super) struct End {
    /// Joint of the wheel; `None` for a foot.
    pub axle: Option<usize>,
    /// Link of the foot or wheel.
    pub link: usize,
    /// Centre in that link.
    pub center_in_link_m: Vector3<f64>,
    pub radius_m: f64,
    /// True if the radius comes from a shape of the URDF.
    pub measured: bool,
    pub kind: EndKind,
    pub tip: Tip,
    /// Contacts of a foot with a sole, around the centre; empty for one contact at the centre.
    pub sole: Vec<Corner>,
}

impl End {
    /// Number of contacts with the ground.
    fn contacts(&self) -> usize {
        self.sole.len().max(1)
    }
}

/// Kind of contact of a guessed foot or wheel.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum EndKind {
    Foot,
    DrivenWheel,
    FreeWheel,
    /// Wheel that no joint turns, with its axis in the link.
    WeldedWheel(Vector3<f64>),
    /// Ball or wheel of the body that rolls freely, with its lateral axis in the link.
    Caster(Vector3<f64>),
}

impl EndKind {
    /// Kind of contact in the spelling of robot files.
    pub fn contact(self) -> &'static str {
        match self {
            Self::Foot => "point_foot",
            Self::DrivenWheel => "actuated_wheel",
            Self::FreeWheel | Self::Caster(_) => "passive_wheel",
            Self::WeldedWheel(_) => "welded_wheel",
        }
    }
}

/// Joints that robot files cannot have, with their locked position.
pub(super) fn locks(urdf: &Urdf, tree: &Tree) -> Vec<(usize, f64)> {
    let locked = |&index: &usize| {
        let joint = &urdf.joints[index];
        let limit = joint.limit;
        let stuck =
            joint.kind == Kind::Revolute && limit.lower.is_some() && limit.lower == limit.upper;
        let foreign = matches!(joint.kind, Kind::Prismatic | Kind::Planar | Kind::Floating);
        let follows = joint.mimics.is_some() && joint.kind != Kind::Fixed;
        (stuck || foreign || follows).then(|| (index, joint.locked_position()))
    };
    tree.order.iter().filter_map(locked).collect()
}

/// Joints without a motor in a file that lists its motors, except axles and joints that a spring holds.
pub(super) fn passive(urdf: &Urdf, bodies: &Bodies, axles: &[usize]) -> Vec<usize> {
    let joints = bodies.moving.iter().map(|moving| moving.joint);
    let is_passive = |joint: &usize| {
        let of = &urdf.joints[*joint];
        let is_held = axles.contains(joint) || urdf.holding_spring(of).is_some();
        urdf.lists_motors && !of.has_motor && !is_held
    };
    joints.filter(is_passive).collect()
}

/// True if a joint has no motor in a file that has motors. Other files do not describe motors.
pub(super) fn lacks_motor(urdf: &Urdf, joint: &Joint) -> bool {
    !joint.has_motor && urdf.joints.iter().any(|other| other.has_motor)
}

/// Feet and wheels that reach the ground together, in the order of limbs.
pub(super) fn ends(urdf: &Urdf, graph: &Graph, bodies: &Bodies, rigid: &Rigid) -> Vec<End> {
    // Sorted by link, because the set has no order.
    let mut axles: Vec<usize> = rigid.wheels.iter().copied().collect();
    axles.sort_by_key(|&axle| graph.ends[axle].1);
    let mut on_body = vec![Vec::new(); bodies.bodies.len()];
    for &axle in &axles {
        if let Some((body, _)) = bodies.places[graph.ends[axle].1] {
            on_body[body].push(axle);
        }
    }
    let size_m = bodies.size_m();
    let children = bodies.children();
    let posed = soles::Posed::new(urdf, bodies, size_m);
    let mut ends = Vec::new();
    for index in 0..bodies.bodies.len() {
        let before = ends.len();
        let wheels = on_body[index].iter();
        ends.extend(wheels.filter_map(|&axle| wheel(urdf, graph, bodies, axle, size_m)));
        if ends.len() > before || children[index] > 0 && index > 0 {
            continue;
        }
        let links = bodies.bodies[index].links.iter().copied();
        let welded: Vec<_> = links.filter_map(|link| welded_wheel(&posed, link)).collect();
        if !welded.is_empty() {
            ends.extend(welded);
        } else if index > 0 {
            ends.extend(foot(&posed, index));
        }
    }
    let mut ends = ground::together(urdf, bodies, ends);
    casters::add(urdf, bodies, &mut ends);
    // A robot file has at most this number.
    ends.truncate(ITEMS_MAX);
    if ends.iter().map(End::contacts).sum::<usize>() > ITEMS_MAX {
        ends.iter_mut().for_each(|end| end.sole.clear());
    }
    ends
}

/// Foot at the end of a body without moving children, with its sole if it has one.
fn foot(posed: &soles::Posed<'_>, body: usize) -> Option<End> {
    let (point, tail) = soles::foot(posed, body)?;
    Some(corners::sole(posed, &tail, &point).unwrap_or(point))
}

fn wheel(urdf: &Urdf, graph: &Graph, bodies: &Bodies, axle: usize, size_m: f64) -> Option<End> {
    let joint = &urdf.joints[axle];
    let disc = axles::disc(urdf, graph, axle, size_m);
    let words = ["caster", "passive", "free"];
    let link = graph.ends[axle].1;
    let called = has(&joint.name, &words) || has(&urdf.links[link].name, &words);
    let kind = match called || lacks_motor(urdf, joint) {
        true => EndKind::FreeWheel,
        false => EndKind::DrivenWheel,
    };
    end(bodies, link, Some(axle), disc.center_m, disc.radius_m, disc.measured, kind)
}

/// Link with the name of a wheel and a disc about a horizontal axis that no joint turns.
fn welded_wheel(posed: &soles::Posed<'_>, link: usize) -> Option<End> {
    let wheel = &posed.urdf.links[link];
    let (radius_m, pose) = wheel.shapes.iter().find_map(|shape| match shape.solid {
        Solid::Cylinder { radius_m, length_m } if length_m < 2.0 * radius_m => {
            Some((radius_m, shape.link_from_shape))
        }
        _ => None,
    })?;
    let axis = pose.rotation * Vector3::z();
    let (body, body_from_link) = posed.bodies.places[link]?;
    let in_root: Vector3<f64> = posed.poses[body].rotation * (body_from_link.rotation * axis);
    if in_root.z.abs() > axles::UPRIGHT || !has(&wheel.name, &axles::WHEELS) {
        return None;
    }
    let kind = EndKind::WeldedWheel(axis);
    end(posed.bodies, link, None, pose.translation.vector, radius_m, true, kind)
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
    let tip = Tip { body, center_m, radius_m, body_from_level: None };
    Some(End { axle, link, center_in_link_m, radius_m, measured, kind, tip, sole: Vec::new() })
}

fn has(name: &str, words: &[&str]) -> bool {
    let name = name.to_ascii_lowercase();
    words.iter().any(|word| name.contains(word))
}
