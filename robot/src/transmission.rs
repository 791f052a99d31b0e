//! Transmission between the motors of joints and the joints: belts, gears and differentials.
//!
//! Row m of A contains the ratios of the motor of joint m. Angles, speeds and accelerations of motors are A times those of the
//! joints. Equal power on both sides gives the torques: τ_joint = Aᵀ τ_motor. Without couplings A is the identity.

use crate::model::{Joint, JointRatio, Robot};
use nalgebra::DMatrix;

/// Smallest ratio of the determinant of A to the product of its rows' lengths. Below it, the motors do not determine the joints.
const DEPENDENT: f64 = 1e-3;

/// Linear map between the joints of a robot and their motors, in joint order.
#[derive(Clone, Debug, PartialEq)]
pub struct Transmission {
    /// Rows of A.
    motor_from_joints: Vec<Vec<JointRatio>>,
    /// Rows of A⁻¹.
    joint_from_motors: Vec<Vec<JointRatio>>,
    /// Rows of A⁻ᵀ.
    torque_factors: Vec<Vec<JointRatio>>,
}

impl Transmission {
    /// Returns the map of a robot. `None` if its couplings are not invertible.
    pub fn new(robot: &Robot) -> Option<Self> {
        let joints = robot.joints.len();
        let rows = robot.joints.iter().enumerate();
        let motor_from_joints: Vec<_> = rows.map(|(index, joint)| row(index, joint)).collect();
        if !robot.joints.iter().any(Joint::is_coupled) {
            return Some(Self {
                joint_from_motors: motor_from_joints.clone(),
                torque_factors: motor_from_joints.clone(),
                motor_from_joints,
            });
        }
        let mut matrix = DMatrix::<f64>::zeros(joints, joints);
        for (motor, row) in motor_from_joints.iter().enumerate() {
            for of in row {
                *matrix.get_mut((motor, of.joint))? += of.ratio;
            }
        }
        let lengths: f64 = matrix.row_iter().map(|row| row.norm()).product();
        let inverse = matrix.clone().try_inverse()?;
        if matrix.determinant().abs() <= DEPENDENT * lengths {
            return None;
        }
        let size = inverse.amax();
        let rows = |matrix: &DMatrix<f64>| {
            let row = |entries: Vec<f64>| {
                let entries = entries.into_iter().enumerate();
                // What is left of entries that cancel is rounding.
                let entries = entries.filter(|(_, ratio)| ratio.abs() > 1e-12 * size);
                entries.map(|(joint, ratio)| JointRatio { joint, ratio }).collect()
            };
            matrix.row_iter().map(|entries| row(entries.iter().copied().collect())).collect()
        };
        Some(Self {
            joint_from_motors: rows(&inverse),
            torque_factors: rows(&inverse.transpose()),
            motor_from_joints,
        })
    }

    /// Number of motors of joints.
    pub fn motor_count(&self) -> usize {
        self.motor_from_joints.len()
    }

    /// Ratios of a motor: its angle is the sum of `ratio` times the angle of `joint`.
    pub fn ratios(&self, motor: usize) -> &[JointRatio] {
        &self.motor_from_joints[motor]
    }

    /// Ratios of a joint: its angle is the sum of `ratio` times the angle of the motor of `joint`.
    pub fn motor_ratios(&self, joint: usize) -> &[JointRatio] {
        &self.joint_from_motors[joint]
    }

    /// Factors of a motor's torque: it is the sum of `ratio` times the torque of `joint`.
    pub fn torque_factors(&self, motor: usize) -> &[JointRatio] {
        &self.torque_factors[motor]
    }

    /// Speed of a joint if all of its motors run at their limits, rad/s.
    pub fn joint_speed_max_rad_s(&self, robot: &Robot, joint: usize) -> f64 {
        let motors = self.joint_from_motors[joint].iter();
        total(motors.map(|of| of.ratio.abs() * robot.joints[of.joint].actuator.speed_max_rad_s))
    }

    /// Motor angles from joint angles, or motor speeds from joint speeds.
    pub fn motors(&self, joints: &[f64]) -> Vec<f64> {
        self.motor_from_joints.iter().map(|row| sum(row, joints)).collect()
    }

    /// Joint angles from motor angles, or joint speeds from motor speeds.
    pub fn joints(&self, motors: &[f64]) -> Vec<f64> {
        self.joint_from_motors.iter().map(|row| sum(row, motors)).collect()
    }

    /// Motor torques from joint torques.
    pub fn motor_torques(&self, joints_nm: &[f64]) -> Vec<f64> {
        self.torque_factors.iter().map(|row| sum(row, joints_nm)).collect()
    }

    /// Joint torques from motor torques.
    pub fn joint_torques(&self, motors_nm: &[f64]) -> Vec<f64> {
        let mut joints_nm = vec![None; motors_nm.len()];
        for (row, torque_nm) in self.motor_from_joints.iter().zip(motors_nm) {
            for of in row {
                let part = of.ratio * torque_nm;
                let sum = &mut joints_nm[of.joint];
                *sum = Some(sum.map_or(part, |sum: f64| sum + part));
            }
        }
        joints_nm.into_iter().map(Option::unwrap_or_default).collect()
    }
}

/// Row of A for the motor of a joint.
fn row(index: usize, joint: &Joint) -> Vec<JointRatio> {
    if joint.is_coupled() {
        return joint.motor_per_joint.clone();
    }
    vec![JointRatio { joint: index, ratio: 1.0 }]
}

fn sum(row: &[JointRatio], of: &[f64]) -> f64 {
    total(row.iter().map(|entry| entry.ratio * of[entry.joint]))
}

/// Sum that keeps the sign of a single zero, so that plans of robots without couplings keep their bytes.
fn total(terms: impl Iterator<Item = f64>) -> f64 {
    terms.reduce(|sum, term| sum + term).unwrap_or(0.0)
}
