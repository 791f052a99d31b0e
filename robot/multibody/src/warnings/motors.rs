//! Warnings about gains and rotor inertias that do not suit the load of the motors, and about motors on a bus without settings.

use super::warning::{CheckedRobot, RobotWarning};
use crate::CompositeInertia;
use rollwalk_robot::{Actuator, Channel, Joint, Robot};

/// Maximum plausible ratio of a joint's rotor inertia to the largest inertia that the joint, or a joint before it, carries.
const ARMATURE_OF_LIMB: f64 = 5.0;
/// Maximum plausible ratio of a joint's rotor inertia to the robot's mass times its squared size. A joint with a very light load
/// may exceed [`ARMATURE_OF_LIMB`] without an error, so a warning needs both.
const ARMATURE_OF_ROBOT: f64 = 0.02;
/// Maximum plausible time in which the torque limit accelerates the rotor alone to the speed limit, s. Hobby servos with gears of
/// 1:345 need 0.06 s, drives with little reduction less. A wrong unit is a factor of 1e4 or more.
const RUN_UP_MAX_S: f64 = 0.3;
/// Maximum plausible deflection of a joint of the standing robot, rad. Real robots reach 0.09.
const YIELDS_MAX_RAD: f64 = 0.15;
/// Maximum plausible time constant kd / kp with which a joint approaches its set-point, s. Real robots reach 0.03.
const FOLLOWS_MAX_S: f64 = 0.08;
/// Maximum plausible damping ratio of a joint whose set-points include a speed. Folded legs have less inertia than stretched
/// ones, for which gains are chosen.
const DAMPING_RATIO_MAX: f64 = 5.0;
/// Assumed period of a drive's damping loop, s. Many drives are faster, few are slower.
const LOOP_S: f64 = 1e-3;

pub(super) fn warnings(seen: &CheckedRobot<'_>) -> Vec<RobotWarning> {
    let (tree, frames) = (seen.tree, &seen.standing.frames);
    let robot = tree.robot();
    let composite = CompositeInertia::new(tree, frames);
    let carried: Vec<f64> =
        (0..robot.joints.len()).map(|joint| composite.joint_inertia(tree, frames, joint)).collect();
    let of_robot_kg_m2 = robot.total_mass_kg() * seen.size_m.powi(2);
    let mut warnings = Vec::new();
    for index in robot.driven_joints() {
        let joint = &robot.joints[index];
        let warning = |text| RobotWarning::of("joint", &joint.name, text);
        let motor = &joint.actuator;
        let before = tree.joints_to_link(joint.child).iter().map(|joint| carried[*joint]);
        let limb_kg_m2 = before.fold(0.0, f64::max);
        let armature_kg_m2 = motor.armature_kg_m2;
        let run_up_s = armature_kg_m2 * motor.speed_max_rad_s / motor.torque_max_nm;
        if armature_kg_m2 > ARMATURE_OF_LIMB * limb_kg_m2
            && armature_kg_m2 > ARMATURE_OF_ROBOT * of_robot_kg_m2
            && run_up_s > RUN_UP_MAX_S
        {
            warnings.push(warning(format!(
                "`armature_kg_m2` is {armature_kg_m2}, {:.0} times the inertia of the limb, so that \
                 the motor needs {run_up_s:.1} s to reach its speed; give the rotor's inertia times \
                 the square of the gear ratio, in kg·m² (1 g·cm² = 1e-7 kg·m², 1 kg·cm² = 1e-4 kg·m²)",
                armature_kg_m2 / limb_kg_m2
            )));
        }
        let yields_rad = (seen.standing.torque_nm[index] / motor.kp_nm_rad).abs();
        if yields_rad > YIELDS_MAX_RAD {
            warnings.push(warning(format!(
                "`kp_nm_rad` is {}, too low to carry the robot: the joint yields by \
                 {yields_rad:.2} rad{}; multiply a value in N·m per degree by 57.3",
                motor.kp_nm_rad,
                of_motor(joint)
            )));
        }
        let inertia_kg_m2 = carried[index] + armature_kg_m2;
        warnings.extend(lag(robot, motor, inertia_kg_m2).map(warning));
        warnings.extend(damping(motor, inertia_kg_m2).map(warning));
    }
    warnings.extend(unset_buses(robot));
    warnings
}

/// Addition to an angle of a prismatic joint.
fn of_motor(joint: &Joint) -> String {
    let travel = joint.travel_m_per_rad;
    travel.map_or_else(String::new, |of| format!(" of its motor, {of} m each"))
}

/// Warnings about motors on a bus without settings, if other buses have them.
fn unset_buses(robot: &Robot) -> Vec<RobotWarning> {
    let is_unset = |channel: &Channel<'_>| {
        !robot.buses.is_empty() && !robot.buses.contains_key(&channel.actuator().bus)
    };
    let warning = |channel: Channel<'_>| {
        let bus = channel.actuator().bus;
        let text = format!(
            "on bus {bus}, which has no [[bus]] and is taken as CAN with servos of the Rollwalk \
             profile; correct `bus`, or add [[bus]] with `number = {bus}`"
        );
        RobotWarning::of("motor", channel.name(), text)
    };
    robot.channels().filter(is_unset).map(warning).collect()
}

/// Warning about a damping that is large for the stiffness.
///
/// Without the speed of a set-point, the damping torque kd q̇ holds the joint back, and it lags by kd / kp. With the speed, the
/// damping acts on q̇* − q̇, and the joint does not lag. If the joint is overdamped, errors still decay with kd / kp.
fn lag(robot: &Robot, motor: &Actuator, inertia_kg_m2: f64) -> Option<String> {
    let Actuator { kp_nm_rad, kd_nm_s_rad, .. } = *motor;
    let follows_s = kd_nm_s_rad / kp_nm_rad;
    if follows_s <= FOLLOWS_MAX_S {
        return None;
    }
    let bus = robot.buses.get(&motor.bus).copied().unwrap_or_default();
    let problem = if bus.takes_joint_speed() {
        let ratio = kd_nm_s_rad / (2.0 * (kp_nm_rad * inertia_kg_m2).sqrt());
        if ratio <= DAMPING_RATIO_MAX {
            return None;
        }
        format!("errors of the joint decay in {follows_s:.2} s")
    } else {
        format!("the joint lags by {follows_s:.2} s")
    };
    Some(format!(
        "`kd_nm_s_rad` is {kd_nm_s_rad}, so that {problem} with `kp_nm_rad` {kp_nm_rad}; give kp \
         times 0.01 to 0.03 s"
    ))
}

/// Warning about unstable damping: a digital loop diverges if I / kd is below half of its period.
fn damping(motor: &Actuator, inertia_kg_m2: f64) -> Option<String> {
    let kd = motor.kd_nm_s_rad;
    let most = 2.0 * inertia_kg_m2 / LOOP_S;
    (kd > most).then(|| {
        format!(
            "`kd_nm_s_rad` is {kd}, unstable in a loop of {:.0} Hz with an inertia of \
             {inertia_kg_m2:.1e} kg·m²; give at most {most:.1} N·m·s/rad",
            1.0 / LOOP_S
        )
    })
}
