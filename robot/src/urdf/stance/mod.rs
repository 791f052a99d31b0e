//! Standing pose for robots whose model has none: legs bent, feet below the hips.
//!
//! A leg moves only joints that carry no other leg. Shared joints, and legs that cannot bend, stay at the angles nearest to 0.
//! Each leg bends in its own plane (`legs`): the foot goes below the first bending joint, or outward from it if legs stand out
//! radially. `reach` solves for the angles.

mod legs;
mod reach;

use super::bodies::{Bodies, motion};
use super::joints::position_limits;
use super::model::{Kind, Urdf};
use legs::Leg;
use nalgebra::{Isometry3, Point3, Unit, UnitQuaternion, Vector3};

pub(super) use legs::{Carried, across, chain};

/// Largest distance of a foot from a goal that its leg reaches, as a fraction of the leg's length.
const MISS: f64 = 0.012;
/// Distances from hip to foot to try, as fractions of the default. Joint limits keep some legs nearly straight.
const EASIER: [f64; 4] = [1.0, 1.1, 1.18, 0.8];
/// Range of depths of a foot below its first bending joint, as fractions of the leg's length, for legs that have to stand as
/// deep as wheels on rigid axles.
const DEPTHS: [f64; 2] = [0.3, 0.97];
/// Smallest height of the first bending joint of a leg that stands in the keyframe `home`, as a fraction of the leg's length.
const AT_HOME: f64 = 0.3;
/// Largest difference in height of feet that are level in the keyframe `home`, as a fraction of the longest leg.
const LEVEL: f64 = 0.1;
/// Number of corrections that put two feet below the centre of mass.
const BALANCING_STEPS: usize = 5;

/// Axis and limits of a joint, and its position in the keyframe `home`, rad or m.
#[derive(Clone, Copy, Debug)]
pub(super) struct Turn {
    pub axis: Unit<Vector3<f64>>,
    pub min_rad: f64,
    pub max_rad: f64,
    pub home_rad: Option<f64>,
}

/// Foot or wheel.
#[derive(Clone, Copy, Debug)]
pub(super) struct Tip {
    pub body: usize,
    pub center_m: Vector3<f64>,
    pub radius_m: f64,
    /// Rotation in the body from axes in which a sole lies flat and points forward, for the middle of a sole.
    pub body_from_level: Option<UnitQuaternion<f64>>,
}

/// Standing pose.
#[derive(Clone, Debug)]
pub(super) struct Stance {
    /// Joint angles in the order of [`Bodies::moving`].
    pub angles_rad: Vec<f64>,
    /// Poses of all bodies in the frame of the root.
    pub poses: Vec<Isometry3<f64>>,
    /// Centres of the tips in the frame of the root.
    pub tips_m: Vec<Vector3<f64>>,
    /// Centre of mass in the frame of the root.
    pub com_m: Vector3<f64>,
    /// Tips above the ground, with their height, m.
    pub missed: Vec<(usize, f64)>,
}

/// Axes and limits of all joints.
pub(super) fn turns(urdf: &Urdf, bodies: &Bodies) -> Vec<Turn> {
    let joints = bodies.moving.iter().map(|moving| &urdf.joints[moving.joint]);
    let turn = |joint: &super::model::Joint| {
        let [min_rad, max_rad] = position_limits(urdf, joint);
        let home_rad = joint.home;
        // A leg stands with half of its stroke left, and bends by the joints that turn.
        if joint.kind == Kind::Prismatic {
            let middle = home_rad.unwrap_or(0.5 * (min_rad + max_rad)).clamp(min_rad, max_rad);
            return Turn { axis: joint.axis, min_rad: middle, max_rad: middle, home_rad };
        }
        // A spring without a motor holds its joint near the rest angle.
        match urdf.holding_spring(joint) {
            Some(spring) => {
                let rest_rad = home_rad.unwrap_or(spring.rest_rad).clamp(min_rad, max_rad);
                Turn { axis: joint.axis, min_rad: rest_rad, max_rad: rest_rad, home_rad }
            }
            None => Turn { axis: joint.axis, min_rad, max_rad, home_rad },
        }
    };
    joints.map(turn).collect()
}

/// Angles at home, else nearest to 0.
pub(super) fn straight(turns: &[Turn]) -> Vec<f64> {
    turns.iter().map(|turn| inside(turn, turn.home_rad.unwrap_or(0.0))).collect()
}

/// Angles nearest to 0.
pub(super) fn zero(turns: &[Turn]) -> Vec<f64> {
    turns.iter().map(|turn| inside(turn, 0.0)).collect()
}

/// Finds a standing pose. The keyframe `home` has priority if the robot stands in it.
pub(super) fn stance(bodies: &Bodies, turns: &[Turn], tips: &[Tip]) -> Stance {
    let mut angles = straight(turns);
    let legs = legs::legs(bodies, turns, &angles, tips);
    let at_home = turns.iter().any(|turn| turn.home_rad.is_some());
    if !at_home || !stands(bodies, turns, &angles, &legs, tips) {
        let zero = zero(turns);
        let legs = legs::legs(bodies, turns, &zero, tips);
        let grounds = EASIER.map(|depth| ground_m(bodies, turns, &zero, &legs, tips, depth));
        let tried = grounds.map(|ground_m| bent(bodies, turns, &zero, &legs, tips, ground_m));
        let length_m = legs.iter().map(|leg| leg.length_m).fold(0.0, f64::max);
        let reached = tried.iter().find(|(_, miss_m)| *miss_m < MISS * length_m);
        let nearest = tried.iter().min_by(|a, b| a.1.total_cmp(&b.1));
        angles = reached.or(nearest).map_or(zero, |(angles, _)| angles.clone());
    }
    let poses = poses(bodies, axes(turns), &angles);
    let tips_m: Vec<_> = tips.iter().map(|tip| at(&poses, tip)).collect();
    let bottoms = tips_m.iter().zip(tips).map(|(center, tip)| center.z - tip.radius_m);
    let lowest_m = bottoms.clone().fold(f64::INFINITY, f64::min);
    let length_m = legs.iter().map(|leg| leg.length_m).fold(0.0, f64::max);
    let above = bottoms.enumerate().map(|(index, bottom_m)| (index, bottom_m - lowest_m));
    let least_m = if legs.is_empty() { f64::INFINITY } else { 2.0 * MISS * length_m };
    let missed = above.filter(|(_, above_m)| *above_m > least_m).collect();
    Stance { angles_rad: angles, tips_m, com_m: com_m(bodies, &poses), missed, poses }
}

/// Angles that put the feet of all legs on the ground, or as near as possible, and the largest remaining distance, m.
fn bent(
    bodies: &Bodies,
    turns: &[Turn],
    zero: &[f64],
    legs: &[Leg],
    tips: &[Tip],
    ground_m: f64,
) -> (Vec<f64>, f64) {
    let mut shift_m = 0.0;
    let steps = if stands_on_two(legs, tips) { BALANCING_STEPS } else { 1 };
    let mut found = (zero.to_vec(), f64::INFINITY);
    for _ in 0..steps {
        let (mut angles, mut worst_m) = (zero.to_vec(), 0.0_f64);
        for leg in legs {
            let goal = leg.goal(ground_m) + leg.out * shift_m;
            let (reached, miss_m) = reach::best(bodies, turns, &angles, leg, &goal);
            (angles, worst_m) = (reached, worst_m.max(miss_m));
        }
        let poses = poses(bodies, axes(turns), &angles);
        let tips_m = tips.iter().map(|tip| at(&poses, tip).x);
        let ahead_m = com_m(bodies, &poses).x - tips_m.sum::<f64>() / tips.len().max(1) as f64;
        found = (angles, worst_m);
        // A robot that cannot reach the point below its centre of mass stands as well as possible.
        if legs.iter().any(|leg| worst_m > MISS * leg.length_m) {
            break;
        }
        shift_m += ahead_m;
    }
    found
}

/// True if the robot stands at home: all feet are level, and the body is above them.
fn stands(bodies: &Bodies, turns: &[Turn], angles: &[f64], legs: &[Leg], tips: &[Tip]) -> bool {
    let poses = poses(bodies, axes(turns), angles);
    let bottoms = tips.iter().map(|tip| at(&poses, tip).z - tip.radius_m);
    let [low, high] = bottoms.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], bottom_m| {
        [low.min(bottom_m), high.max(bottom_m)]
    });
    let length_m = legs.iter().map(|leg| leg.length_m).fold(0.0, f64::max);
    let is_above = |leg: &Leg| leg.hip_m.z > low + AT_HOME * leg.length_m;
    high - low <= LEVEL * length_m && legs.iter().all(is_above)
}

/// Height of the ground below the root: that of rigid tips if all legs reach it, else the depth of the shortest leg.
fn ground_m(
    bodies: &Bodies,
    turns: &[Turn],
    angles: &[f64],
    legs: &[Leg],
    tips: &[Tip],
    depth: f64,
) -> f64 {
    let own = legs.iter().map(|leg| leg.own_ground_m(depth)).fold(f64::NEG_INFINITY, f64::max);
    let poses = poses(bodies, axes(turns), angles);
    let bends = |tip: &Tip| legs.iter().any(|leg| leg.body == tip.body);
    let rigid = tips.iter().filter(|tip| !bends(tip));
    let rigid = rigid.map(|tip| at(&poses, tip).z - tip.radius_m).reduce(f64::min);
    let fits = |ground_m: &f64| {
        legs.iter().all(|leg| {
            let depth_m = leg.hip_m.z - ground_m - leg.radius_m;
            (DEPTHS[0] * leg.length_m..=DEPTHS[1] * leg.length_m).contains(&depth_m)
        })
    };
    rigid.filter(fits).unwrap_or(own)
}

/// True if the robot stands on one or two legs alone, which bend forward.
fn stands_on_two(legs: &[Leg], tips: &[Tip]) -> bool {
    let on_legs = tips.iter().all(|tip| legs.iter().any(|leg| leg.body == tip.body));
    legs.len() <= 2 && on_legs && legs.iter().all(|leg| !leg.is_radial)
}

/// Centre of mass in the frame of the root, m.
fn com_m(bodies: &Bodies, poses: &[Isometry3<f64>]) -> Vector3<f64> {
    let weighted = bodies
        .bodies
        .iter()
        .zip(poses)
        .map(|(body, pose)| (pose * Point3::from(body.mass.com_m)).coords * body.mass.mass_kg);
    let mass_kg: f64 = bodies.bodies.iter().map(|body| body.mass.mass_kg).sum();
    weighted.sum::<Vector3<f64>>() / mass_kg
}

/// Poses of all bodies in the frame of the root, at the given positions of joints, rad or m, about or along the given axes.
pub(super) fn poses<'a>(
    bodies: &Bodies,
    axes: impl IntoIterator<Item = &'a Unit<Vector3<f64>>>,
    angles_rad: &[f64],
) -> Vec<Isometry3<f64>> {
    let mut poses = vec![Isometry3::identity(); bodies.bodies.len()];
    for (moving, (axis, &angle)) in bodies.moving.iter().zip(axes.into_iter().zip(angles_rad)) {
        let kind = if moving.slides { Kind::Prismatic } else { Kind::Revolute };
        let motion = motion(kind, axis, angle);
        poses[moving.child] = poses[moving.parent] * moving.parent_from_joint * motion;
    }
    poses
}

fn axes(turns: &[Turn]) -> impl Iterator<Item = &Unit<Vector3<f64>>> {
    turns.iter().map(|turn| &turn.axis)
}

/// Centre of a tip in the frame of the root, m.
pub(super) fn at(poses: &[Isometry3<f64>], tip: &Tip) -> Vector3<f64> {
    (poses[tip.body] * Point3::from(tip.center_m)).coords
}

/// Angle within the limits, with a margin. The angle 0 needs no margin.
fn inside(turn: &Turn, angle_rad: f64) -> f64 {
    let margin = (0.02 * (turn.max_rad - turn.min_rad)).min(0.05);
    let (min, max) = (turn.min_rad + margin, turn.max_rad - margin);
    if angle_rad == 0.0 && (turn.min_rad..=turn.max_rad).contains(&0.0) {
        0.0
    } else {
        angle_rad.clamp(min, max)
    }
}
