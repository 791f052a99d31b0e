//! Motor torques that the planned forces require, against torque limits and torque-speed lines.
//!
//! They follow from virtual work, not from the optimiser's equations: the torque of a joint is minus the power of
//! ground forces and weight per unit of its rate, with the limb at rest.

use super::Grid;
use super::grid::{State, Timeline};
use super::rows::{Worst, feet};
use crate::families::Family;
use rollwalk_multibody::euler::JOINTS;
use rollwalk_robot::{Actuator, GRAVITY_M_S2};

/// Torques of joints and driven wheels at the samples, torque-speed lines on the intervals.
pub fn torques(timeline: &Timeline) -> Vec<Worst> {
    let mut joint = Worst::of(Family::JointTorque, Grid::Samples);
    let mut wheel = Worst::of(Family::WheelTorque, Grid::Samples);
    let mut line = Worst::of(Family::TorqueSpeedLine, Grid::Samples);
    let robot = &timeline.plan.robot;
    let driven =
        || feet(timeline).filter_map(|(j, foot)| Some((j, foot, foot.contact.actuator()?)));
    for w in timeline.samples() {
        for (j, of) in robot.joints.iter().enumerate() {
            let limit = of.actuator.torque_max_nm;
            let beyond = (joint_torque_nm(timeline, w.here, j).abs() - limit).max(0.0);
            joint.see_beyond(beyond, limit, &w, Some(&of.name));
        }
        for (j, foot, motor) in driven() {
            let limit = motor.torque_max_nm;
            let beyond = (wheel_torque_nm(timeline, w.here, j).abs() - limit).max(0.0);
            wheel.see_beyond(beyond, limit, &w, Some(&foot.name));
        }
    }
    let h = timeline.spacing_s();
    for w in timeline.intervals() {
        let mean =
            |torque_nm: &dyn Fn(&State) -> f64| 0.5 * (torque_nm(w.here) + torque_nm(w.after));
        for (j, of) in robot.joints.iter().enumerate() {
            let torque_nm = mean(&|state| joint_torque_nm(timeline, state, j));
            let speed_rad_s = (w.after.sample.joint_rad[j] - w.here.sample.joint_rad[j]) / h;
            if let Some(beyond) = beyond_line(&of.actuator, torque_nm, speed_rad_s) {
                line.see(beyond, &w, Some(&of.name));
            }
        }
        for (j, foot, motor) in driven().filter(|(j, ..)| !timeline.plan.motion.held_wheels[*j]) {
            let torque_nm = mean(&|state| wheel_torque_nm(timeline, state, j));
            let speed_rad_s = w.here.sample.end_effectors[j].motor_speed_rad_s;
            if let Some(beyond) = beyond_line(motor, torque_nm, speed_rad_s) {
                line.see(beyond, &w, Some(&foot.name));
            }
        }
    }
    vec![joint, wheel, line]
}

/// Minus the power of ground forces and weight per unit of the joint's rate, N·m.
fn joint_torque_nm(timeline: &Timeline, state: &State, joint: usize) -> f64 {
    let model = &timeline.model;
    // Of the robot's mass only that which the joint moves shifts the centre of mass.
    let weight_n = model.total_mass_kg() * GRAVITY_M_S2;
    let mut power = -weight_n * state.pose.d_com[JOINTS + joint].z;
    for (j, at) in state.pose.end_effectors.iter().enumerate() {
        let Some(column) = model.chain(j).dofs.iter().position(|&dof| dof == JOINTS + joint) else {
            continue;
        };
        // The material point at the contact moves with the link, regardless of the wheel's spin.
        let arm = state.contact(j) - at.center;
        let velocity = at.d_center[column] + at.d_rotation[column].cross(&arm);
        power += state.force(j).dot(&velocity);
    }
    -power
}

/// Minus the power of the ground force per unit of the wheel's spin, N·m: the rim moves against its
/// rolling direction.
fn wheel_torque_nm(timeline: &Timeline, state: &State, j: usize) -> f64 {
    let radius_m = timeline.plan.robot.end_effectors[j].radius_m;
    state.force(j).dot(&state.frames[j].rolling) * radius_m
}

/// Excess of a torque at a speed over the torque-speed line; `None` without a line.
fn beyond_line(motor: &Actuator, torque_nm: f64, speed_rad_s: f64) -> Option<f64> {
    let line = motor.torque_speed?;
    let used = torque_nm / line.stall_torque_nm + speed_rad_s / line.no_load_speed_rad_s;
    Some((used.abs() - 1.0).max(0.0))
}
