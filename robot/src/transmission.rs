//! Transmission between the motors of joints and the joints: belts, gears, differentials and linkages.
//!
//! Row m of A contains the ratios of the motor of joint m. Speeds of motors are A times those of the joints. Equal power on both
//! sides gives the torques: τ_joint = Aᵀ τ_motor. Without couplings A is the identity. With linkages it depends on the pose.

use crate::linkage::CrankMap;
use crate::model::{Joint, JointRatio, Robot};
use nalgebra::DMatrix;
use std::borrow::Cow;

/// Smallest ratio of the determinant of A to the product of its rows' lengths. Below it, the motors do not determine the joints.
const DEPENDENT: f64 = 1e-3;
/// Maximum number of Newton steps from motor angles to joint angles, and their largest change of a joint, rad.
const STEPS: usize = 50;
const STEP_RAD: f64 = 0.3;

/// Map between the joints of a robot and their motors, in joint order.
#[derive(Clone, Debug, PartialEq)]
pub struct Transmission {
    /// Ratios in the nominal pose.
    nominal: Ratios,
    /// Servos with crank and rod, by joint.
    cranks: Vec<(usize, CrankMap)>,
    nominal_rad: Vec<f64>,
}

/// Ratios of all motors in one pose.
#[derive(Clone, Debug, PartialEq)]
pub struct Ratios {
    /// Rows of A.
    motor_from_joints: Vec<Vec<JointRatio>>,
    /// Rows of A⁻¹.
    joint_from_motors: Vec<Vec<JointRatio>>,
    /// Rows of A⁻ᵀ.
    torque_factors: Vec<Vec<JointRatio>>,
    /// Angles of the motors; empty if all ratios are constant.
    motor_rad: Vec<f64>,
    /// Second derivatives of the angle of each motor, for pairs of joints in both orders; empty if all ratios are constant.
    bends: Vec<Vec<(usize, usize, f64)>>,
}

impl Transmission {
    /// Returns the map of a robot. `None` if its couplings are not invertible in the nominal pose.
    pub fn new(robot: &Robot) -> Option<Self> {
        let mut cranks = Vec::new();
        for (index, joint) in robot.joints.iter().enumerate() {
            if let Some(linkage) = &joint.linkage {
                cranks.push((index, CrankMap::new(robot, joint, linkage)?));
            }
        }
        let rows = robot.joints.iter().enumerate().map(|(index, joint)| row(index, joint));
        let nominal_rad: Vec<_> = robot.joints.iter().map(|joint| joint.nominal_rad).collect();
        let nominal = match robot.joints.iter().any(Joint::is_coupled) {
            false => Ratios::of_joints(rows.collect()),
            true => Ratios::new(rows.collect(), &cranks, &nominal_rad)?,
        };
        Some(Self { nominal, cranks, nominal_rad })
    }

    /// True if ratios depend on the pose.
    pub fn has_linkages(&self) -> bool {
        !self.cranks.is_empty()
    }

    /// Number of motors of joints.
    pub fn motor_count(&self) -> usize {
        self.nominal.motor_from_joints.len()
    }

    /// Ratios in the nominal pose. Without linkages they hold in every pose.
    pub fn nominal(&self) -> &Ratios {
        &self.nominal
    }

    /// Ratios at joint angles, rad.
    pub fn at(&self, joint_rad: &[f64]) -> Cow<'_, Ratios> {
        if self.cranks.is_empty() {
            return Cow::Borrowed(&self.nominal);
        }
        let rows = self.nominal.motor_from_joints.clone();
        // Singular poses are beyond the limits of joints; any ratios do there.
        Ratios::new(rows, &self.cranks, joint_rad).map_or(Cow::Borrowed(&self.nominal), Cow::Owned)
    }

    /// Motor angles from joint angles, rad.
    pub fn motors(&self, joint_rad: &[f64]) -> Vec<f64> {
        let mut motors = self.nominal.motors(joint_rad);
        for (index, crank) in &self.cranks {
            motors[*index] = crank.angle_rad(joint_rad);
        }
        motors
    }

    /// Joint angles from motor angles, rad. Joints of linkages are those nearest to the nominal pose.
    pub fn joints(&self, motor_rad: &[f64]) -> Vec<f64> {
        if self.cranks.is_empty() {
            return self.nominal.joints(motor_rad);
        }
        let mut joint_rad = self.nominal_rad.clone();
        for _ in 0..STEPS {
            let off = self.motors(&joint_rad);
            let off: Vec<_> = motor_rad.iter().zip(off).map(|(to, at)| to - at).collect();
            let step = self.at(&joint_rad).joints(&off);
            let mut largest: f64 = 0.0;
            for (angle, step) in joint_rad.iter_mut().zip(step) {
                *angle += step.clamp(-STEP_RAD, STEP_RAD);
                largest = largest.max(step.abs());
            }
            if largest < 1e-12 {
                break;
            }
        }
        joint_rad
    }
}

impl Ratios {
    /// Ratios of motors that each turn their own joint.
    fn of_joints(rows: Vec<Vec<JointRatio>>) -> Self {
        Self {
            joint_from_motors: rows.clone(),
            torque_factors: rows.clone(),
            motor_from_joints: rows,
            motor_rad: Vec::new(),
            bends: Vec::new(),
        }
    }

    /// Ratios at joint angles, with `rows` for motors without linkages. `None` if they are not invertible.
    fn new(
        mut rows: Vec<Vec<JointRatio>>,
        cranks: &[(usize, CrankMap)],
        joint_rad: &[f64],
    ) -> Option<Self> {
        let joints = rows.len();
        let (mut motor_rad, mut bends) = (Vec::new(), Vec::new());
        if !cranks.is_empty() {
            motor_rad = rows.iter().map(|row| sum(row, joint_rad)).collect();
            bends = vec![Vec::new(); joints];
            for (index, crank) in cranks {
                let state = crank.state(joint_rad);
                rows[*index] = state.ratios;
                motor_rad[*index] = state.angle_rad;
                bends[*index] = state.bends;
            }
        }
        let mut matrix = DMatrix::<f64>::zeros(joints, joints);
        for (motor, row) in rows.iter().enumerate() {
            for of in row {
                *matrix.get_mut((motor, of.joint))? += of.ratio;
            }
        }
        let lengths: f64 = matrix.row_iter().map(|row| row.norm()).product();
        let inverse = matrix.clone().try_inverse()?;
        if matrix.determinant().abs() <= DEPENDENT * lengths {
            return None;
        }
        let groups = groups(&rows);
        let size = inverse.amax();
        // Of constant ratios, what is left of entries that cancel is rounding. Other ratios keep the same entries in all poses.
        let keeps = |row: usize, column: usize, ratio: f64| match cranks.is_empty() {
            true => ratio.abs() > 1e-12 * size,
            false => groups[row] == groups[column],
        };
        let entries = |matrix: &DMatrix<f64>| {
            let row = |row: usize| {
                let entries = (0..joints).map(|joint| (joint, matrix[(row, joint)]));
                let kept = entries.filter(|(joint, ratio)| keeps(row, *joint, *ratio));
                kept.map(|(joint, ratio)| JointRatio { joint, ratio }).collect()
            };
            (0..joints).map(row).collect()
        };
        Some(Self {
            joint_from_motors: entries(&inverse),
            torque_factors: entries(&inverse.transpose()),
            motor_from_joints: rows,
            motor_rad,
            bends,
        })
    }

    /// Ratios of a motor: its speed is the sum of `ratio` times the speed of `joint`.
    pub fn ratios(&self, motor: usize) -> &[JointRatio] {
        &self.motor_from_joints[motor]
    }

    /// Ratios of a joint: its speed is the sum of `ratio` times the speed of the motor of `joint`.
    pub fn motor_ratios(&self, joint: usize) -> &[JointRatio] {
        &self.joint_from_motors[joint]
    }

    /// Factors of a motor's torque: it is the sum of `ratio` times the torque of `joint`.
    pub fn torque_factors(&self, motor: usize) -> &[JointRatio] {
        &self.torque_factors[motor]
    }

    /// Angle of a motor, rad; `None` if all ratios are constant.
    pub fn motor_rad(&self, motor: usize) -> Option<f64> {
        self.motor_rad.get(motor).copied()
    }

    /// Second derivatives of the angle of a motor with respect to pairs of joints, in both orders. Empty for constant ratios.
    pub fn bends(&self, motor: usize) -> &[(usize, usize, f64)] {
        self.bends.get(motor).map_or(&[], Vec::as_slice)
    }

    /// Speed of a joint if all of its motors run at their limits, rad/s.
    pub fn joint_speed_max_rad_s(&self, robot: &Robot, joint: usize) -> f64 {
        let motors = self.joint_from_motors[joint].iter();
        total(motors.map(|of| of.ratio.abs() * robot.joints[of.joint].actuator.speed_max_rad_s))
    }

    /// Torque on a joint if all of its motors are at their limits, N·m.
    pub fn joint_torque_max_nm(&self, robot: &Robot, joint: usize) -> f64 {
        let motors = self.motor_from_joints.iter().zip(&robot.joints);
        total(motors.flat_map(|(row, of)| {
            let on_joint = row.iter().filter(|ratio| ratio.joint == joint);
            on_joint.map(|ratio| ratio.ratio.abs() * of.actuator.torque_max_nm)
        }))
    }

    /// Motor speeds from joint speeds.
    pub fn motors(&self, joints: &[f64]) -> Vec<f64> {
        self.motor_from_joints.iter().map(|row| sum(row, joints)).collect()
    }

    /// Joint speeds from motor speeds.
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
    if joint.motor_per_joint.is_empty() {
        return vec![JointRatio { joint: index, ratio: 1.0 }];
    }
    joint.motor_per_joint.clone()
}

/// Number of the group of each joint: joints that motors turn together are in one group.
fn groups(rows: &[Vec<JointRatio>]) -> Vec<usize> {
    let mut groups: Vec<usize> = (0..rows.len()).collect();
    for (motor, row) in rows.iter().enumerate() {
        for of in row {
            let [from, to] = [groups[of.joint], groups[motor]];
            groups.iter_mut().filter(|group| **group == from).for_each(|group| *group = to);
        }
    }
    groups
}

fn sum(row: &[JointRatio], of: &[f64]) -> f64 {
    total(row.iter().map(|entry| entry.ratio * of[entry.joint]))
}

/// Sum that keeps the sign of a single zero, so that plans of robots without couplings keep their bytes.
fn total(terms: impl Iterator<Item = f64>) -> f64 {
    terms.reduce(|sum, term| sum + term).unwrap_or(0.0)
}
