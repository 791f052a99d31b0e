//! Motor torques that the planned forces require, compared with torque limits and torque-speed lines.
//!
//! The torques follow from virtual work, independently of the optimiser's equations. A joint's torque is minus the power of
//! ground forces, weight, springs and inertia of all mass points per unit of joint rate, plus the torque that accelerates its
//! rotor. The torque of a passive joint is the one that its spring does not balance.

use super::grid::{State, Timeline, Window, feet};
use super::residual::{Grid, WorstCase};
use crate::families::Family;
use crate::motion::Ends;
use nalgebra::Vector3;
use rollwalk_multibody::euler::JOINTS;
use rollwalk_robot::{Actuator, GRAVITY_M_S2, Joint};

/// Residuals of joint and wheel torques, and of torque-speed lines: at the samples for joints, on the intervals for wheels.
pub fn torques(timeline: &Timeline) -> Vec<WorstCase> {
    let mut joint = WorstCase::of(Family::JointTorque, Grid::Samples);
    let mut passive = WorstCase::of(Family::PassiveJoint, Grid::Samples);
    let mut wheel = WorstCase::of(Family::WheelTorque, Grid::Samples);
    let mut line = WorstCase::of(Family::TorqueSpeedLine, Grid::Samples);
    let robot = &timeline.plan.robot;
    let periodic = timeline.plan.motion.ends == Ends::Periodic;
    let driven =
        || feet(timeline).filter_map(|(j, foot)| Some((j, foot, foot.contact.actuator()?)));
    let h = timeline.spacing_s();
    for w in timeline.samples() {
        let torques = joint_torques_nm(timeline, &w);
        // Set-point lines apply where an interval begins.
        let begins = periodic || w.index + 1 < timeline.plan.samples.len();
        for ((j, of), torque_nm) in robot.joints.iter().enumerate().zip(torques) {
            if of.is_passive() {
                passive.record(torque_nm.abs(), &w, Some(&of.name));
                continue;
            }
            let limit = of.actuator.torque_max_nm;
            let beyond = (torque_nm.abs() - limit).max(0.0);
            joint.record_excess(beyond, limit, &w, Some(&of.name));
            let motor_rad = |state: &State| motor_rad(timeline, state, j);
            let [before, after] = [w.before, w.after].map(motor_rad);
            let speed_rad_s = (after - before) / (2.0 * h);
            let beyond = beyond_line(&of.actuator, torque_nm, speed_rad_s);
            if let Some(beyond) = beyond.filter(|_| begins) {
                line.record(beyond, &w, Some(&of.name));
            }
        }
        for (j, foot, motor) in driven() {
            let limit = motor.torque_max_nm;
            let beyond = (wheel_torque_nm(timeline, w.here, j).abs() - limit).max(0.0);
            wheel.record_excess(beyond, limit, &w, Some(&foot.name));
        }
    }
    for w in timeline.intervals() {
        let mean =
            |torque_nm: &dyn Fn(&State) -> f64| 0.5 * (torque_nm(w.here) + torque_nm(w.after));
        for (j, foot, motor) in driven().filter(|(j, ..)| !timeline.plan.motion.held_wheels[*j]) {
            let torque_nm = mean(&|state| wheel_torque_nm(timeline, state, j));
            let speed_rad_s = w.here.sample.end_effectors[j].motor_speed_rad_s;
            if let Some(beyond) = beyond_line(motor, torque_nm, speed_rad_s) {
                line.record(beyond, &w, Some(&foot.name));
            }
        }
    }
    let mut rows = vec![joint, wheel, line];
    if robot.joints.iter().any(Joint::is_passive) {
        rows.insert(1, passive);
    }
    rows
}

/// Torques of the motors of joints, N·m. A joint's torque is minus the power of ground forces, weight, springs and inertia per
/// unit of joint rate, plus the torque that accelerates rotors.
fn joint_torques_nm(timeline: &Timeline, w: &Window) -> Vec<f64> {
    let model = &timeline.model;
    let here = w.here;
    let per_h2 = timeline.mean_of_second_derivative(w);
    let gravity = Vector3::new(0.0, 0.0, -GRAVITY_M_S2);
    let bent = |of: &dyn Fn(&State) -> Vector3<f64>| {
        (of(w.before) - of(here) * 2.0 + of(w.after)) * per_h2
    };
    let joints = &timeline.plan.robot.joints;
    let rotors: Vec<f64> = (joints.iter().enumerate())
        .map(|(j, joint)| {
            let angle = |state: &State| Vector3::repeat(motor_rad(timeline, state, j));
            joint.actuator.armature_kg_m2 * bent(&angle).x
        })
        .collect();
    let ratios = here.pose.frames.ratios(model.tree());
    let mut torques = ratios.joint_torques(&rotors);
    for (l, link) in timeline.plan.robot.links.iter().enumerate() {
        let center = |state: &State| state.pose.frames.point(l, &link.com_in_link_m);
        let push = (bent(&center) - gravity) * link.mass_kg;
        for &j in model.tree().joints_to_link(l) {
            let w_j = here.pose.frames.joint_axes[j];
            let origin = here.pose.frames.link_origins[timeline.plan.robot.joints[j].child];
            torques[j] +=
                push.dot(&here.pose.frames.joint_displacement(j, &(center(here) - origin)));
            for (axis, second) in &timeline.principal[l] {
                let turned = |state: &State| state.pose.frames.world_from_link[l] * axis;
                torques[j] += second * bent(&turned).dot(&w_j.cross(&turned(here)));
            }
        }
    }
    for (index, at) in here.pose.end_effectors.iter().enumerate() {
        // The material point at the contact moves with the link, regardless of the wheel's spin.
        let arm = here.contact(index) - at.center;
        for (column, &dof) in model.chain(index).dofs.iter().enumerate().skip(JOINTS) {
            let velocity = at.d_center[column] + at.d_rotation[column].cross(&arm);
            torques[dof - JOINTS] -= here.force(index).dot(&velocity);
        }
    }
    for ((j, joint), torque_nm) in joints.iter().enumerate().zip(&mut torques) {
        let Some(spring) = &joint.spring else { continue };
        let [before, here, after] =
            [w.before, here, w.after].map(|state| state.sample.joint_rad[j]);
        let stretch = here - spring.rest_rad;
        let turned = (after - before) / (2.0 * timeline.spacing_s());
        *torque_nm += spring.stiffness_nm_rad * stretch + spring.damping_nm_s_rad * turned;
    }
    ratios.motor_torques(&torques)
}

/// Angle of the motor of a joint, rad.
fn motor_rad(timeline: &Timeline, state: &State, joint: usize) -> f64 {
    timeline.model.tree().transmission().motors(&state.sample.joint_rad)[joint]
}

/// Torque of a wheel, N·m: minus the power of the ground force per unit of spin. The rim at the contact moves against the
/// rolling direction.
fn wheel_torque_nm(timeline: &Timeline, state: &State, j: usize) -> f64 {
    let radius_m = timeline.plan.robot.end_effectors[j].radius_m;
    state.force(j).dot(&state.frames[j].rolling) * radius_m
}

/// Excess over the torque-speed line, as a fraction of the line; `None` for a motor without a line.
fn beyond_line(motor: &Actuator, torque_nm: f64, speed_rad_s: f64) -> Option<f64> {
    let line = motor.torque_speed?;
    let used = torque_nm / line.stall_torque_nm + speed_rad_s / line.no_load_speed_rad_s;
    Some((used.abs() - 1.0).max(0.0))
}
