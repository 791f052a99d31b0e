//! Axes of the root link that point forward and up, from the names of limbs and the axes of knees and wheels.

use super::super::bodies::Bodies;
use super::super::model::Urdf;
use super::super::side::direction;
use super::super::stance::{self, Carried};
use super::End;
use nalgebra::{Isometry3, Point3, Vector3};

/// Words in names of limbs on each side of the body, lower case.
const FRONT: [&str; 6] = ["front", "fore", "fl", "fr", "lf", "rf"];
const REAR: [&str; 13] =
    ["rear", "hind", "back", "hl", "hr", "lh", "rh", "rl", "rr", "bl", "br", "lb", "rb"];
const LEFT: [&str; 9] = ["left", "l", "fl", "lf", "hl", "lh", "rl", "bl", "lb"];
const RIGHT: [&str; 9] = ["right", "r", "fr", "rf", "hr", "rh", "rr", "br", "rb"];

/// Words in names of legs.
const LEG: [&str; 7] = ["leg", "foot", "ankle", "knee", "toe", "thigh", "shank"];

/// Words that also count inside longer words. `fore` is not among them, because a forearm is not in front.
const LONG: [&str; 10] =
    ["left", "right", "front", "rear", "hind", "foot", "ankle", "knee", "thigh", "shank"];

/// Fraction of a direction's length above which its component along an axis of the root makes it parallel to this axis.
const ALONG: f64 = 0.75;
/// Length of the mean of unit vectors above which the limbs count as parallel.
const SAME: f64 = 0.8;

/// Axes of the root link, as indices into [`super::super::side::AXES`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(in super::super) struct Axes {
    pub forward: usize,
    pub up: usize,
}

/// Axes, and the evidence for others than the default.
#[derive(Clone, Copy, Debug)]
pub(in super::super) struct Heading {
    pub axes: Axes,
    /// Evidence for other axes than the default; `None` without evidence.
    pub because: Option<&'static str>,
    /// True if knees or wheels turn about the axis that points forward by the names.
    pub contradicts: bool,
}

/// Limb in the root frame, with all joints at 0.
struct Limb {
    words: Vec<String>,
    hip: Vector3<f64>,
    /// Unit vector from the first joint to the last body.
    along: Option<Vector3<f64>>,
}

impl Limb {
    /// True if a name has one of these words, or contains a long one, as `leftfoot` does.
    fn is_called(&self, words: &[&str]) -> bool {
        let is_part =
            |name: &str, word: &str| name == word || LONG.contains(&word) && name.contains(word);
        self.words.iter().any(|name| words.iter().any(|word| is_part(name, word)))
    }

    /// True if the names put the limb on the first side, false on the second; `None` if they do not decide.
    fn side(&self, sides: [&[&str]; 2]) -> Option<bool> {
        let [first, second] = sides.map(|side| self.is_called(side));
        (first != second).then_some(first)
    }
}

/// Index of the axis that a vector is along; `None` between axes.
fn axis(vector: &Vector3<f64>) -> Option<usize> {
    let largest = vector.iamax();
    let is_along = vector[largest].abs() > ALONG * vector.norm();
    is_along.then_some(2 * largest + usize::from(vector[largest] < 0.0))
}

/// Axis of the root link that points up. `bodies` has the axes of the root, and wheels are separate.
pub(in super::super) fn up(urdf: &Urdf, bodies: &Bodies) -> usize {
    const UP: usize = 4;
    let limbs = limbs(urdf, bodies);
    let is_leg = |limb: &&Limb| limb.is_called(&LEG);
    let called = limbs.iter().filter(is_leg).count() > 1;
    let legs: Vec<&Limb> = limbs.iter().filter(|limb| !called || is_leg(limb)).collect();
    let along: Vec<_> = legs.iter().filter_map(|limb| limb.along).collect();
    let hanging = along.iter().sum::<Vector3<f64>>() / along.len().max(1) as f64;
    // Two limbs with unknown names may be arms.
    let least = if called { 2 } else { 3 };
    let hanging = axis(&hanging).filter(|_| along.len() >= least && hanging.norm() > SAME);
    let opposite = |axis: usize| axis ^ 1;
    let named = apart(&limbs, [&FRONT, &REAR]).zip(apart(&limbs, [&LEFT, &RIGHT]));
    if let Some(up) = named.and_then(|(front, left)| axis(&front.cross(&left))) {
        // Names according to which the ground is above the robot are wrong.
        return if hanging == Some(up) { opposite(up) } else { up };
    }
    match hanging {
        // Limbs that point forward are in the plane of their first joints.
        Some(down) if across_hips(&legs, &direction(down)) => opposite(down),
        _ => UP,
    }
}

/// True if the first joints of the limbs lie in a plane across a direction.
fn across_hips(limbs: &[&Limb], direction: &Vector3<f64>) -> bool {
    let ends = |of: &dyn Fn(&Limb) -> f64| {
        let all = limbs.iter().map(|limb| of(limb));
        all.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], at| [low.min(at), high.max(at)])
    };
    let spread = |along: Vector3<f64>| {
        let [low, high] = ends(&|limb| limb.hip.dot(&along));
        high - low
    };
    let spreads = [Vector3::x(), Vector3::y(), Vector3::z()].map(spread);
    spread(*direction) < 0.5 * spreads.into_iter().fold(0.0, f64::max)
}

/// Axis of the root link that points forward. Both sets of bodies have the axes of the root; in `whole` wheels are part of
/// their limbs. `ends` stand on the ground.
pub(in super::super) fn forward(
    urdf: &Urdf,
    bodies: &Bodies,
    whole: &Bodies,
    ends: &[End],
    up: usize,
) -> Heading {
    let limbs = limbs(urdf, bodies);
    let up_axis = direction(up);
    let level = |of: Vector3<f64>| of - up_axis * of.dot(&up_axis);
    let front = apart(&limbs, [&FRONT, &REAR]).map(level);
    let left = apart(&limbs, [&LEFT, &RIGHT]).map(|left| left.cross(&up_axis));
    let named = [front, left].into_iter().flatten().find_map(|forward| axis(&forward));
    // +x, or +y if x is up.
    let default = if up / 2 == 0 { 2 } else { 0 };
    let lateral = lateral(urdf, whole, ends, &up_axis);
    let by_axes = lateral.map(|lateral| {
        let free = (0..3).find(|axis| *axis != up / 2 && *axis != lateral);
        2 * free.unwrap_or_default()
    });
    let (forward, because) = match (named, by_axes) {
        (Some(named), _) => (named, "the names of limbs"),
        (None, Some(axes)) => (axes, "the axes of knees or wheels"),
        (None, None) => (default, "the axis that points up"),
    };
    let axes = Axes { forward, up };
    let is_default = axes == Axes { forward: 0, up: 4 };
    let contradicts = named.is_some() && lateral == Some(forward / 2);
    Heading { axes, because: (!is_default).then_some(because), contradicts }
}

/// Vector from the middle of the limbs on the second side to that of the first; `None` without names of both.
fn apart(limbs: &[Limb], sides: [&[&str]; 2]) -> Option<Vector3<f64>> {
    let middle = |side: bool| {
        let on = limbs.iter().filter(|limb| limb.side(sides) == Some(side));
        let hips: Vec<_> = on.map(|limb| limb.hip).collect();
        (!hips.is_empty()).then(|| hips.iter().sum::<Vector3<f64>>() / hips.len() as f64)
    };
    Some(middle(true)? - middle(false)?)
}

/// Coordinate axis of the root that all knees and wheels turn about; `None` if they differ.
fn lateral(urdf: &Urdf, bodies: &Bodies, ends: &[End], up: &Vector3<f64>) -> Option<usize> {
    let turns = stance::turns(urdf, bodies);
    let straight = stance::straight(&turns);
    let poses = stance::poses(bodies, turns.iter().map(|turn| &turn.axis), &straight);
    let carried = Carried::new(bodies, ends.iter().map(|end| end.tip.body));
    let mut found = None;
    for end in ends {
        let across = match end.axle {
            Some(axle) => {
                let (body, pose) = bodies.places[end.link]?;
                Some(poses[body] * pose * urdf.joints[axle].axis.into_inner())
            }
            None => {
                let own = carried.own_joints(bodies, end.tip.body);
                stance::across(bodies, &turns, &poses, &own, up)
            }
        };
        let Some(across) = across else { continue };
        let axis = axis(&across).filter(|axis| direction(*axis).dot(&across).abs() > 0.9)? / 2;
        if *found.get_or_insert(axis) != axis {
            return None;
        }
    }
    found
}

fn limbs(urdf: &Urdf, bodies: &Bodies) -> Vec<Limb> {
    let mut poses = vec![Isometry3::identity(); bodies.bodies.len()];
    for moving in &bodies.moving {
        poses[moving.child] = poses[moving.parent] * moving.parent_from_joint;
    }
    let leaves = bodies.leaves();
    let carried = Carried::new(bodies, leaves.iter().copied());
    let limb = |&leaf: &usize| {
        let own = carried.own_joints(bodies, leaf);
        let first = own.first().map_or(leaf, |&joint| bodies.moving[joint].child);
        let hip = poses[first].translation.vector;
        let joints = own.iter().map(|&joint| urdf.joints[bodies.moving[joint].joint].name.as_str());
        let on_way = own.iter().map(|&joint| bodies.moving[joint].child);
        let links = on_way.flat_map(|body| &bodies.bodies[body].links);
        let links = links.map(|&link| urdf.links[link].name.as_str());
        let com = (poses[leaf] * Point3::from(bodies.bodies[leaf].mass.com_m)).coords;
        let along = if own.len() > 1 { (com - hip).try_normalize(1e-6) } else { None };
        Limb { words: joints.chain(links).flat_map(words).collect(), hip, along }
    };
    leaves.iter().map(limb).collect()
}

/// Words of a name in lower case, from forms such as `front_left`, `LF_FOOT`, `frontLeft` or `FL2`.
fn words(name: &str) -> Vec<String> {
    let mut words: Vec<String> = Vec::new();
    let mut before = ' ';
    for letter in name.chars() {
        let begins = !before.is_alphabetic() || before.is_lowercase() && letter.is_uppercase();
        if letter.is_alphabetic() {
            if begins {
                words.push(String::new());
            }
            if let Some(word) = words.last_mut() {
                word.extend(letter.to_lowercase());
            }
        }
        before = letter;
    }
    words
}
