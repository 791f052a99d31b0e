//! Legs: the joints that move one foot alone, and the plane in which they bend.

use super::super::bodies::Bodies;
use super::{Tip, Turn, at, axes, poses};
use nalgebra::{Isometry3, Vector3};
use std::collections::BTreeSet;

/// Depth of the foot below the first bending joint, as a fraction of the leg's length.
const DEPTH: f64 = 0.8;
/// Depth, and distance outward, of the foot of a leg that stands out radially.
const RADIAL_DEPTH: f64 = 0.6;
const RADIAL_OUT: f64 = 0.45;
/// Largest vertical component of the axis of a joint that bends the leg.
const LEVEL: f64 = 0.7;
/// Smallest cosine of the angle between two parallel axes.
const PARALLEL: f64 = 0.9;

/// Leg that bends in a vertical plane.
pub(super) struct Leg {
    pub body: usize,
    /// Joints that move this foot alone, from the root to the tip.
    pub own: Vec<usize>,
    /// Joints about the normal of the plane, the first of the leg first.
    pub bending: Vec<usize>,
    /// Horizontal direction in the plane: forward, or outward.
    pub out: Vector3<f64>,
    /// Normal of the plane: z × `out`.
    pub across: Vector3<f64>,
    pub hip_m: Vector3<f64>,
    pub tip_m: Vector3<f64>,
    pub tip: Tip,
    pub length_m: f64,
    pub radius_m: f64,
    pub is_radial: bool,
}

impl Leg {
    /// Height of the ground on which the leg stands best. `depth` is a factor of the usual depth.
    pub fn own_ground_m(&self, depth: f64) -> f64 {
        let usual = if self.is_radial { RADIAL_DEPTH } else { DEPTH };
        self.hip_m.z - depth * usual * self.length_m - self.radius_m
    }

    /// Target position of the foot's centre on ground at height `ground_m`, m.
    pub fn goal(&self, ground_m: f64) -> Vector3<f64> {
        let out_m = if self.is_radial { RADIAL_OUT * self.length_m } else { 0.0 };
        let mut goal = self.hip_m + self.out * out_m;
        // The leg keeps its distance from the plane through its hip.
        goal += self.across * (self.tip_m - self.hip_m).dot(&self.across);
        goal.z = ground_m + self.radius_m;
        goal
    }
}

/// Number of tips that each joint carries; several tips of a body count once.
pub(in super::super) struct Carried {
    counts: Vec<usize>,
}

impl Carried {
    /// Counts the bodies in `tips` behind each joint.
    pub fn new(bodies: &Bodies, tips: impl IntoIterator<Item = usize>) -> Self {
        let mut counts = vec![0; bodies.moving.len()];
        let distinct: BTreeSet<usize> = tips.into_iter().collect();
        for tip in distinct {
            chain(bodies, tip).into_iter().for_each(|joint| counts[joint] += 1);
        }
        Self { counts }
    }

    /// Joints between the root and `body` that turn and carry no other body with a tip, from the root outwards.
    pub fn own_joints(&self, bodies: &Bodies, body: usize) -> Vec<usize> {
        let mut own = chain(bodies, body);
        own.retain(|&joint| self.counts[joint] == 1 && !bodies.moving[joint].slides);
        own
    }
}

/// Joints between the root and a body, from the root outwards.
pub(in super::super) fn chain(bodies: &Bodies, body: usize) -> Vec<usize> {
    let (mut chain, mut body) = (Vec::new(), body);
    while body > 0 {
        // Joint i carries body i + 1.
        chain.push(body - 1);
        body = bodies.moving[body - 1].parent;
    }
    chain.reverse();
    chain
}

/// Horizontal axis about which most of these joints turn, at least two, in axes of the root.
pub(in super::super) fn across(
    bodies: &Bodies,
    turns: &[Turn],
    poses: &[Isometry3<f64>],
    own: &[usize],
    up: &Vector3<f64>,
) -> Option<Vector3<f64>> {
    let axis = |joint: usize| poses[bodies.moving[joint].child].rotation * *turns[joint].axis;
    let level: Vec<_> =
        own.iter().map(|&joint| axis(joint)).filter(|axis| axis.dot(up).abs() < LEVEL).collect();
    let same =
        |axis: &Vector3<f64>| level.iter().filter(|other| other.dot(axis).abs() > PARALLEL).count();
    // Of equals, the last one is the knee.
    let best = level.iter().max_by_key(|axis| same(axis))?;
    (same(best) > 1).then_some(*best)
}

/// Legs that bend, in the order of their first tips.
pub(super) fn legs(bodies: &Bodies, turns: &[Turn], straight: &[f64], tips: &[Tip]) -> Vec<Leg> {
    let poses = poses(bodies, axes(turns), straight);
    let carried = Carried::new(bodies, tips.iter().map(|tip| tip.body));
    let mut legs: Vec<Leg> = Vec::new();
    for tip in tips {
        if legs.iter().any(|leg| leg.body == tip.body) {
            continue;
        }
        // Of several contacts of a body, the lowest.
        let on_body = tips.iter().filter(|other| other.body == tip.body);
        let bottom = |tip: &&Tip| at(&poses, tip).z - tip.radius_m;
        let Some(tip) = on_body.min_by(|a, b| bottom(a).total_cmp(&bottom(b))) else { continue };
        let own = carried.own_joints(bodies, tip.body);
        legs.extend(leg(bodies, turns, &poses, own, tip));
    }
    let is_radial = legs.iter().any(|leg| leg.across.y.abs() < PARALLEL);
    let middle = legs.iter().map(|leg| leg.hip_m).sum::<Vector3<f64>>() / legs.len().max(1) as f64;
    for leg in &mut legs {
        let forward = leg.across.cross(&Vector3::z());
        let outward = if is_radial { forward.dot(&(leg.hip_m - middle)) } else { forward.x };
        leg.out = if outward < 0.0 { -forward } else { forward }.normalize();
        leg.across = Vector3::z().cross(&leg.out);
        leg.is_radial = is_radial;
    }
    legs
}

fn leg(
    bodies: &Bodies,
    turns: &[Turn],
    poses: &[Isometry3<f64>],
    own: Vec<usize>,
    tip: &Tip,
) -> Option<Leg> {
    let across = across(bodies, turns, poses, &own, &Vector3::z())?;
    let level = Vector3::new(across.x, across.y, 0.0).normalize();
    let child = |joint: usize| poses[bodies.moving[joint].child];
    let bends = |joint: &usize| {
        (child(*joint).rotation * *turns[*joint].axis).dot(&across).abs() > PARALLEL
    };
    let bending: Vec<_> = own.iter().copied().filter(bends).collect();
    let hip = *bending.first()?;
    let tip_m = at(poses, tip);
    let after = own.iter().skip_while(|&&joint| joint != hip);
    let mut points: Vec<_> = after.map(|&joint| child(joint).translation.vector).collect();
    points.push(tip_m);
    // Offsets along the axes do not add to the reach.
    let in_plane = |of: Vector3<f64>| (of - level * of.dot(&level)).norm();
    let length_m = points.windows(2).map(|ends| in_plane(ends[1] - ends[0])).sum();
    let hip_m = points[0];
    Some(Leg {
        body: tip.body,
        own,
        bending,
        out: Vector3::zeros(),
        across: level,
        hip_m,
        tip_m,
        tip: *tip,
        length_m,
        radius_m: tip.radius_m,
        is_radial: false,
    })
}
