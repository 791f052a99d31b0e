//! A standing pose for robots whose URDF has none: legs bent, feet below the hips.
//!
//! A leg's hip is its first joint about a lateral axis. Its foot goes below the hip, 0.8 of the leg's
//! length deep or, if other legs are shorter, as deep as theirs; knees bend backward unless limits forbid
//! it. Legs without such a joint, and those that cannot get there, stay next to angle 0.

use super::bodies::{Bodies, motion};
use super::model::Kind;
use nalgebra::{DMatrix, DVector, Isometry3, Point3, Unit, Vector3};

/// Depth of the foot below the hip as a share of the leg's length.
const BENT: f64 = 0.8;
/// First guess: the hip forward or back by this, the knee twice as much the other way, rad.
const BEND_RAD: f64 = 0.6;
/// Largest distance of a foot from its goal, m.
const MISS_M: f64 = 0.005;
/// Damping of the least squares, m.
const DAMPING_M: f64 = 0.02;
/// Weight of the three directions: a leg without a joint for it cannot choose how far out it stands.
const WEIGHTS: Vector3<f64> = Vector3::new(1.0, 0.1, 1.0);
/// Steps of the least squares; it needs about ten.
const STEPS: usize = 200;

/// Axis and limits of a joint.
#[derive(Clone, Copy, Debug)]
pub(super) struct Turn {
    pub axis: Unit<Vector3<f64>>,
    pub min_rad: f64,
    pub max_rad: f64,
}

/// A foot or wheel.
#[derive(Clone, Copy, Debug)]
pub(super) struct Tip {
    pub body: usize,
    pub center_m: Vector3<f64>,
    pub radius_m: f64,
}

#[derive(Clone, Debug)]
pub(super) struct Stance {
    /// Joint angles in the order of [`Bodies::moving`].
    pub angles_rad: Vec<f64>,
    /// Centres of the tips in the frame of the root.
    pub tips_m: Vec<Vector3<f64>>,
    /// Tips that are not below their hip.
    pub missed: Vec<usize>,
}

struct Leg {
    /// Joints from the root to the tip.
    chain: Vec<usize>,
    /// Joints about a lateral axis, the hip first.
    bending: Vec<usize>,
    hip_m: Vector3<f64>,
    tip_m: Vector3<f64>,
    length_m: f64,
}

/// Finds a standing pose.
pub(super) fn stance(bodies: &Bodies, turns: &[Turn], tips: &[Tip]) -> Stance {
    let straight: Vec<f64> = turns.iter().map(|turn| inside(turn, 0.0)).collect();
    let legs: Vec<_> = tips.iter().map(|tip| leg(bodies, turns, &straight, tip)).collect();
    let depth = |(leg, tip): (&Option<Leg>, &Tip)| {
        leg.as_ref().map(|leg| leg.hip_m.z - BENT * leg.length_m - tip.radius_m)
    };
    let ground_m = legs.iter().zip(tips).filter_map(depth).fold(f64::NEG_INFINITY, f64::max);
    let mut angles = straight;
    let mut missed = Vec::new();
    let mut placed = vec![false; turns.len()];
    for (index, (leg, tip)) in legs.iter().zip(tips).enumerate() {
        let free = leg.as_ref().filter(|leg| !leg.chain.iter().any(|&joint| placed[joint]));
        let Some(leg) = free else { continue };
        let goal = Vector3::new(leg.hip_m.x, leg.tip_m.y, ground_m + tip.radius_m);
        let tries = [1.0, -1.0].map(|side| reach(bodies, turns, &angles, leg, tip, &goal, side));
        let [back, ahead] = tries;
        let (best, miss_m) = if back.1 < MISS_M || back.1 <= ahead.1 { back } else { ahead };
        if miss_m < MISS_M {
            angles = best;
        } else {
            missed.push(index);
        }
        leg.chain.iter().for_each(|&joint| placed[joint] = true);
    }
    let poses = poses(bodies, axes(turns), &angles);
    let tips_m = tips.iter().map(|tip| at(&poses, tip)).collect();
    Stance { angles_rad: angles, tips_m, missed }
}

/// Poses of all bodies in the frame of the root, at these angles about these axes.
pub(super) fn poses<'a>(
    bodies: &Bodies,
    axes: impl IntoIterator<Item = &'a Unit<Vector3<f64>>>,
    angles_rad: &[f64],
) -> Vec<Isometry3<f64>> {
    let mut poses = vec![Isometry3::identity(); bodies.bodies.len()];
    for (moving, (axis, &angle)) in bodies.moving.iter().zip(axes.into_iter().zip(angles_rad)) {
        let motion = motion(Kind::Revolute, axis, angle);
        poses[moving.child] = poses[moving.parent] * moving.parent_from_joint * motion;
    }
    poses
}

fn axes(turns: &[Turn]) -> impl Iterator<Item = &Unit<Vector3<f64>>> {
    turns.iter().map(|turn| &turn.axis)
}

fn at(poses: &[Isometry3<f64>], tip: &Tip) -> Vector3<f64> {
    (poses[tip.body] * Point3::from(tip.center_m)).coords
}

/// The angle, a little off the limits.
fn inside(turn: &Turn, angle_rad: f64) -> f64 {
    let margin = (0.02 * (turn.max_rad - turn.min_rad)).min(0.05);
    let (min, max) = (turn.min_rad + margin, turn.max_rad - margin);
    // Zero is a fine angle even on a limit.
    if angle_rad == 0.0 && (turn.min_rad..=turn.max_rad).contains(&0.0) {
        0.0
    } else {
        angle_rad.clamp(min, max)
    }
}

fn leg(bodies: &Bodies, turns: &[Turn], straight: &[f64], tip: &Tip) -> Option<Leg> {
    let mut chain = Vec::new();
    let mut body = tip.body;
    while let Some(joint) = bodies.moving.iter().position(|moving| moving.child == body) {
        chain.push(joint);
        body = bodies.moving[joint].parent;
    }
    chain.reverse();
    let poses = poses(bodies, axes(turns), straight);
    let child = |joint: usize| poses[bodies.moving[joint].child];
    let lateral =
        |joint: &usize| (child(*joint).rotation * turns[*joint].axis.into_inner()).y.abs() > 0.7;
    let bending: Vec<_> = chain.iter().copied().filter(lateral).collect();
    // A leg that bends has a knee.
    let &[hip, _, ..] = &bending[..] else { return None };
    let tip_m = at(&poses, tip);
    let after = chain.iter().skip_while(|&&joint| joint != hip);
    let mut points: Vec<_> = after.map(|&joint| child(joint).translation.vector).collect();
    points.push(tip_m);
    // Offsets along the axes of hip and knee do not reach down.
    let length_m = points.windows(2).map(|ends| (ends[1] - ends[0]).xz().norm()).sum();
    Some(Leg { hip_m: points[0], chain, bending, tip_m, length_m })
}

/// Damped least squares from a bent leg to the goal; the angles and the remaining distance, m.
fn reach(
    bodies: &Bodies,
    turns: &[Turn],
    angles_rad: &[f64],
    leg: &Leg,
    tip: &Tip,
    goal: &Vector3<f64>,
    side: f64,
) -> (Vec<f64>, f64) {
    let mut angles = angles_rad.to_vec();
    let straight = poses(bodies, axes(turns), angles_rad);
    for (number, &joint) in leg.bending.iter().take(2).enumerate() {
        let axis = straight[bodies.moving[joint].child].rotation * turns[joint].axis.into_inner();
        // About +y, a positive angle swings what hangs down backward.
        let bend = if number == 0 { BEND_RAD } else { -2.0 * BEND_RAD };
        angles[joint] = inside(&turns[joint], side * bend * axis.y.signum());
    }
    let miss = |angles: &[f64]| {
        (goal - at(&poses(bodies, axes(turns), angles), tip)).component_mul(&WEIGHTS)
    };
    for _ in 0..STEPS {
        let error = miss(&angles);
        if error.norm() < 1e-9 {
            break;
        }
        let now = poses(bodies, axes(turns), &angles);
        let mut jacobian = DMatrix::zeros(3, leg.chain.len());
        for (column, &joint) in leg.chain.iter().enumerate() {
            let pose = now[bodies.moving[joint].child];
            let arm = at(&now, tip) - pose.translation.vector;
            let axis = pose.rotation * turns[joint].axis.into_inner();
            jacobian.set_column(column, &axis.cross(&arm).component_mul(&WEIGHTS));
        }
        let normal = &jacobian * jacobian.transpose() + DMatrix::identity(3, 3) * DAMPING_M.powi(2);
        let Some(solved) = normal.cholesky() else { break };
        let pull = DVector::from_column_slice(error.as_slice());
        let step = jacobian.transpose() * solved.solve(&pull);
        for (column, &joint) in leg.chain.iter().enumerate() {
            angles[joint] = inside(&turns[joint], angles[joint] + step[column].clamp(-0.3, 0.3));
        }
    }
    let miss_m = miss(&angles).xz().norm();
    (angles, miss_m)
}
