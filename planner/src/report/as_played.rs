//! Motor torques of the played motion, and the force at the base that no ground contact can supply. [`crate::torque`] computes
//! both.

use super::grid::Timeline;
use super::residual::{Grid, Row, WorstCase};
use crate::families::Family;
use crate::plan::Plan;
use crate::torque::InverseDynamics;
use rollwalk_robot::Channel;
use serde::Serialize;

/// Largest torque of one motor while a motion is played.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct LargestTorque {
    /// Name of the joint or wheel.
    pub motor: String,
    /// Kind of the motor.
    pub kind: MotorKind,
    /// Magnitude of the torque, N·m.
    pub torque_nm: f64,
    /// Limit of the robot file, N·m.
    pub limit_nm: f64,
    /// Time of that torque, s.
    pub time_s: f64,
}

/// Kind of a motor: a joint or a wheel.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum MotorKind {
    /// A joint.
    Joint,
    /// A wheel.
    Wheel,
}

/// Computes the torques of the whole robot at the frame rate of a library. Returns the largest torque of every motor, and rows
/// of the excesses over torque limits and of the force and moment that no contact supplies.
pub fn as_played(plan: &Plan, frames: &Timeline) -> (Vec<LargestTorque>, Vec<Row>) {
    let grid = Grid::Library60Hz;
    let mut joint = WorstCase::of(Family::JointTorqueAsPlayed, grid);
    let mut wheel = WorstCase::of(Family::WheelTorqueAsPlayed, grid);
    let mut force = WorstCase::of(Family::UnmetForce, grid);
    let mut moment = WorstCase::of(Family::UnmetMoment, grid);
    let mut largest: Vec<LargestTorque> = plan.robot.channels().map(LargestTorque::new).collect();
    let mut inverse = InverseDynamics::new(plan);
    for w in frames.samples() {
        let time_s = w.here.sample.time_s;
        let actuation = inverse.at(time_s);
        force.record(actuation.unmet_force_n.norm(), &w, None);
        moment.record(actuation.unmet_moment_nm.norm(), &w, None);
        for (torque_nm, largest) in actuation.channels_nm(&plan.robot).zip(&mut largest) {
            let (torque_nm, limit) = (torque_nm.abs(), largest.limit_nm);
            let worst = if largest.kind == MotorKind::Joint { &mut joint } else { &mut wheel };
            worst.record_excess((torque_nm - limit).max(0.0), limit, &w, Some(&largest.motor));
            if torque_nm > largest.torque_nm {
                (largest.torque_nm, largest.time_s) = (torque_nm, time_s);
            }
        }
    }
    let rows = [joint, wheel, force, moment].into_iter();
    (largest, rows.filter_map(|worst| worst.row_as_played(frames)).collect())
}

impl LargestTorque {
    fn new(channel: Channel) -> Self {
        let kind = match channel {
            Channel::Joint(_) => MotorKind::Joint,
            Channel::Wheel(..) => MotorKind::Wheel,
        };
        Self {
            motor: channel.name().to_owned(),
            kind,
            torque_nm: 0.0,
            limit_nm: channel.actuator().torque_max_nm,
            time_s: 0.0,
        }
    }

    /// Torque as a fraction of the limit.
    pub fn part_of_limit(&self) -> f64 {
        self.torque_nm / self.limit_nm
    }
}
