//! Gains and rotor inertias against what the motors move.

use super::seen::{Doubt, Seen};
use crate::CompositeInertia;
use rollwalk_robot::Actuator;

/// Rotor inertia of a joint over the largest inertia that it, or a joint before it, carries.
const ARMATURE_OF_LIMB: f64 = 5.0;
/// The same over the robot's mass times the square of its size: joints that carry next to nothing have more of the former.
const ARMATURE_OF_ROBOT: f64 = 0.02;
/// Largest plausible deflection of a joint as the robot stands, rad. Robots that were built reach 0.09.
const YIELDS_MAX_RAD: f64 = 0.15;
/// Steps of the loop in which a drive damps its motor, s: many are shorter, few are longer.
const LOOP_S: f64 = 1e-3;

pub(super) fn doubts(seen: &Seen<'_>) -> Vec<Doubt> {
    let (tree, frames) = (seen.tree, &seen.standing.frames);
    let robot = tree.robot();
    let composite = CompositeInertia::new(tree, frames);
    let carried: Vec<f64> =
        (0..robot.joints.len()).map(|joint| composite.joint_inertia(tree, frames, joint)).collect();
    let of_robot_kg_m2 = robot.total_mass_kg() * seen.size_m.powi(2);
    let mut doubts = Vec::new();
    for (index, joint) in robot.joints.iter().enumerate() {
        let doubt = |text| Doubt::of("joint", &joint.name, text);
        let motor = &joint.actuator;
        let before = tree.joints_to_link(joint.child).iter().map(|joint| carried[*joint]);
        let limb_kg_m2 = before.fold(0.0, f64::max);
        let armature_kg_m2 = motor.armature_kg_m2;
        if armature_kg_m2 > ARMATURE_OF_LIMB * limb_kg_m2
            && armature_kg_m2 > ARMATURE_OF_ROBOT * of_robot_kg_m2
        {
            doubts.push(doubt(format!(
                "`armature_kg_m2` is {armature_kg_m2}, {:.0} times what the limb itself has: it is the rotor's inertia times the square of the gear ratio; \
                 g·cm² has to be multiplied by 1e-7, kg·cm² by 1e-4",
                armature_kg_m2 / limb_kg_m2
            )));
        }
        let yields_rad = (seen.standing.torque_nm[index] / motor.kp_nm_rad).abs();
        if yields_rad > YIELDS_MAX_RAD {
            doubts.push(doubt(format!(
                "`kp_nm_rad` is {}, too soft to carry the robot: it yields by {yields_rad:.2} rad; a value in N·m per degree has to be multiplied by 57.3",
                motor.kp_nm_rad
            )));
        }
        doubts.extend(damping(motor, carried[index] + armature_kg_m2).map(doubt));
    }
    doubts
}

/// Damping that a digital loop cannot apply: with I / kd below half of its step the speed grows from step to step.
fn damping(motor: &Actuator, inertia_kg_m2: f64) -> Option<String> {
    let kd = motor.kd_nm_s_rad;
    let most = 2.0 * inertia_kg_m2 / LOOP_S;
    (kd > most).then(|| {
        format!(
            "`kd_nm_s_rad` is {kd}, more than a loop of {:.0} Hz can damp an inertia of {inertia_kg_m2:.1e} kg·m² with: it is stable up to {most:.1}",
            1.0 / LOOP_S
        )
    })
}
