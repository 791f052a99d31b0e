//! Ends that reach the ground together. Arms, heads and grippers do not.

use super::super::bodies::Bodies;
use super::super::model::Urdf;
use super::super::stance::{self, Carried};
use super::{End, EndKind};
use nalgebra::{Point3, Vector3};

/// Largest height of a standing end above the lowest one, as a fraction of the height of its limb's first joint.
const LEVEL: f64 = 0.25;
/// Smallest depth of a hanging limb's end below its first joint, as a fraction of the limb's length.
const HANGS: f64 = 0.3;
/// Largest relative difference in length between limbs that count as equal.
const SAME_MAKE: f64 = 0.1;
/// Minimum number of limbs that stand although none of them hangs, such as those of an insect.
const CRAWLER: usize = 3;

/// Limb of an end, with joints at the angles nearest 0 or at home.
struct Limb {
    /// Number of joints.
    joints: usize,
    hip_z_m: f64,
    bottom_m: f64,
    length_m: f64,
    is_wheel: bool,
    /// True if at least two joints turn about the same horizontal axis.
    bends: bool,
}

impl Limb {
    fn hangs(&self) -> bool {
        self.is_wheel || self.bottom_m < self.hip_z_m - HANGS * self.length_m
    }

    /// True if two limbs have equal joints and about equal length.
    fn is_like(&self, other: &Self) -> bool {
        let apart_m = (self.length_m - other.length_m).abs();
        let higher_m = (self.hip_z_m - other.hip_z_m).abs();
        self.is_wheel == other.is_wheel
            && self.joints == other.joints
            && self.joints > 0
            && apart_m <= SAME_MAKE * self.length_m.max(other.length_m)
            && higher_m <= HANGS * self.length_m
    }
}

/// Keeps the ends that stand on the ground together.
pub(super) fn together(urdf: &Urdf, bodies: &Bodies, ends: Vec<End>) -> Vec<End> {
    let limbs = limbs(urdf, bodies, &ends);
    let standing = standing(&limbs);
    ends.into_iter().zip(standing).filter_map(|(end, stands)| stands.then_some(end)).collect()
}

fn standing(limbs: &[Limb]) -> Vec<bool> {
    let mut out = vec![false; limbs.len()];
    let hanging: Vec<bool> = limbs.iter().map(Limb::hangs).collect();
    if !hanging.contains(&true) {
        // Limbs that spread from the body: an insect, or the arms of a robot on a base.
        return vec![limbs.len() >= CRAWLER; limbs.len()];
    }
    loop {
        let stands = level(limbs, &hanging, &out);
        let count = stands.iter().filter(|stands| **stands).count();
        let left = hanging.iter().zip(&out).filter(|(hangs, out)| **hangs && !**out).count();
        // A single arm that hangs lower than the legs is excluded.
        let lone = stands.iter().position(|stands| *stands);
        match lone {
            Some(lone) if count == 1 && left > 2 => out[lone] = true,
            _ => return stands,
        }
    }
}

/// Limbs whose end is about as low as the lowest end or wheel, and limbs that equal one of them.
fn level(limbs: &[Limb], hanging: &[bool], out: &[bool]) -> Vec<bool> {
    let used = |index: usize| hanging[index] && !out[index];
    let of = |wheels: bool| {
        let limbs = limbs.iter().enumerate();
        let lows = limbs.filter(|(index, limb)| used(*index) && (limb.is_wheel || !wheels));
        lows.map(|(_, limb)| limb.bottom_m).reduce(f64::min)
    };
    let Some(lowest_m) = of(false) else { return vec![false; limbs.len()] };
    let wheel_m = of(true);
    let ground_m = wheel_m.unwrap_or(lowest_m);
    // Heights count from the lowest end to the highest first joint.
    let top_m = limbs.iter().map(|limb| limb.hip_z_m).reduce(f64::max).unwrap_or(lowest_m);
    let stands: Vec<bool> = limbs
        .iter()
        .enumerate()
        .map(|(index, limb)| {
            let height_m = match limb.is_wheel {
                true => top_m - ground_m,
                false => limb.hip_z_m - ground_m,
            };
            // A gripper may lie at the height of the wheels.
            let is_leg = limb.is_wheel || limb.bends || wheel_m.is_none();
            used(index) && is_leg && limb.bottom_m <= ground_m + LEVEL * height_m.max(0.0) + 1e-9
        })
        .collect();
    let like = |index: usize| {
        let mut others = limbs.iter().zip(&stands);
        others.any(|(other, stands)| *stands && limbs[index].is_like(other)) && hanging[index]
    };
    (0..limbs.len()).map(|index| stands[index] || like(index) && !out[index]).collect()
}

fn limbs(urdf: &Urdf, bodies: &Bodies, ends: &[End]) -> Vec<Limb> {
    let turns = stance::turns(urdf, bodies);
    let poses =
        stance::poses(bodies, turns.iter().map(|turn| &turn.axis), &stance::straight(&turns));
    let carried = Carried::new(bodies, ends.iter().map(|end| end.tip.body));
    let limb = |end: &End| {
        let own = carried.own_joints(bodies, end.tip.body);
        let tip = (poses[end.tip.body] * Point3::from(end.tip.center_m)).coords;
        let mut points: Vec<_> =
            own.iter().map(|&joint| poses[bodies.moving[joint].child].translation.vector).collect();
        points.push(tip);
        let length_m = points.windows(2).map(|ends| (ends[1] - ends[0]).norm()).sum::<f64>();
        Limb {
            joints: own.len(),
            hip_z_m: points[0].z,
            bottom_m: tip.z - end.tip.radius_m,
            length_m,
            is_wheel: end.kind != EndKind::Foot,
            bends: stance::across(bodies, &turns, &poses, &own, &Vector3::z()).is_some(),
        }
    };
    ends.iter().map(limb).collect()
}
