//! Load of each joint in the standing pose, from which its default gains follow.

use super::bodies::Bodies;
use super::stance::{Tip, poses};
use crate::GRAVITY_M_S2;
use nalgebra::{Isometry3, Point3, Unit, Vector3};

/// Deflection of a joint of a leg under its load at the longest lever, rad. A bent leg sinks by a few per cent of its length.
pub(super) const LEG_YIELDS_RAD: f64 = 0.3;
/// Deflection of a joint of an arm under the weight of the stretched arm, rad.
const ARM_YIELDS_RAD: f64 = 0.12;

/// Deflection of a prismatic joint of a leg under its load, as a fraction of the leg's length.
const SLIDE_YIELDS: f64 = 0.01;
/// Deflection of a prismatic joint of an arm under the weight beyond it, m.
const ARM_YIELDS_M: f64 = 0.01;

/// Load of one joint. A prismatic joint has N, m and kg in place of N·m, rad and kg·m².
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Load {
    /// Torque that the joint has to hold at the longest lever, N·m: its limb's share of the weight times the length of the
    /// limb, or the moment of all masses beyond the joint, if that is larger.
    pub holds_nm: f64,
    /// Deflection under this torque, rad.
    pub yields_rad: f64,
    /// Inertia of all moved bodies about the joint's axis in the standing pose, without rotors, kg·m².
    pub inertia_kg_m2: f64,
}

impl Load {
    /// Load of a prismatic joint at the pinion of its motor.
    pub fn at_pinion(&self, travel_m_per_rad: f64) -> Self {
        Self {
            holds_nm: self.holds_nm * travel_m_per_rad,
            yields_rad: self.yields_rad / travel_m_per_rad,
            inertia_kg_m2: self.inertia_kg_m2 * travel_m_per_rad * travel_m_per_rad,
        }
    }
}

/// Loads of all joints in the order of [`Bodies::moving`]. `limbs` has the limb of each body.
pub(super) fn loads(
    bodies: &Bodies,
    axes: &[Unit<Vector3<f64>>],
    angles_rad: &[f64],
    limbs: &[usize],
    tips: &[Tip],
) -> Vec<Load> {
    let poses = poses(bodies, axes, angles_rad);
    let weight_n: f64 =
        bodies.bodies.iter().map(|body| body.mass.mass_kg).sum::<f64>() * GRAVITY_M_S2;
    // Supports are limbs with feet or wheels, and each foot or wheel of the body itself.
    let mut standing: Vec<_> =
        tips.iter().filter(|tip| tip.body > 0).map(|tip| limbs[tip.body]).collect();
    standing.sort_unstable();
    standing.dedup();
    let supports = standing.len() + tips.iter().filter(|tip| tip.body == 0).count();
    let length = |limb: usize| {
        let tips = tips.iter().filter(|tip| tip.body > 0 && limbs[tip.body] == limb);
        tips.map(|tip| length_m(bodies, &poses, tip)).fold(0.0, f64::max)
    };
    let load = |(joint, axis): (usize, &Unit<Vector3<f64>>)| {
        let child = bodies.moving[joint].child;
        if bodies.moving[joint].slides {
            let beyond = beyond(bodies, child).into_iter();
            let mass_kg: f64 = beyond.map(|body| bodies.bodies[body].mass.mass_kg).sum();
            let share_n = weight_n / supports.max(1) as f64;
            let length_m = length(limbs[child]);
            let stands = length_m > 0.0;
            let (holds, yields) = match stands {
                true => (share_n.max(mass_kg * GRAVITY_M_S2), SLIDE_YIELDS * length_m),
                false => (mass_kg * GRAVITY_M_S2, ARM_YIELDS_M),
            };
            return Load { holds_nm: holds, yields_rad: yields, inertia_kg_m2: mass_kg };
        }
        let axis = poses[child].rotation * axis.into_inner();
        let origin = poses[child].translation.vector;
        let (mut inertia_kg_m2, mut beyond_nm) = (0.0, 0.0);
        for body in beyond(bodies, child) {
            let mass = &bodies.bodies[body].mass;
            let arm = (poses[body] * Point3::from(mass.com_m)).coords - origin;
            let axis_in_body = poses[body].rotation.inverse() * axis;
            inertia_kg_m2 += axis_in_body.dot(&(mass.inertia_kg_m2 * axis_in_body))
                + mass.mass_kg * axis.cross(&arm).norm_squared();
            beyond_nm += mass.mass_kg * GRAVITY_M_S2 * arm.norm();
        }
        let share_n = weight_n / supports.max(1) as f64;
        let length_m = length(limbs[child]);
        let yields_rad = if length_m > 0.0 { LEG_YIELDS_RAD } else { ARM_YIELDS_RAD };
        Load { holds_nm: beyond_nm.max(share_n * length_m), yields_rad, inertia_kg_m2 }
    };
    axes.iter().enumerate().map(load).collect()
}

/// Body and all bodies that it carries.
fn beyond(bodies: &Bodies, body: usize) -> Vec<usize> {
    let mut found = vec![body];
    // Parents come first.
    for moving in &bodies.moving {
        if found.contains(&moving.parent) {
            found.push(moving.child);
        }
    }
    found
}

/// Length of the limb of a tip, from the limb's first joint along its joints, m.
fn length_m(bodies: &Bodies, poses: &[Isometry3<f64>], tip: &Tip) -> f64 {
    let mut length_m = tip.center_m.norm();
    let mut body = tip.body;
    while let Some(moving) = bodies.moving.iter().find(|moving| moving.child == body) {
        if moving.parent > 0 {
            let [here, next] = [body, moving.parent].map(|body| poses[body].translation.vector);
            length_m += (here - next).norm();
        }
        body = moving.parent;
    }
    length_m
}
