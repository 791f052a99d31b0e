//! Evaluation of a plan at any time and any rate.
//!
//! The optimiser computes a pose every few hundredths of a second. Servos need one every 16 ms, the controller every few
//! milliseconds. Splines with two continuous derivatives join the free coordinates: base, joints and wheel angles. Centre of
//! mass, contact points and wheel axes are computed from the pose. Forces and torques are linear between samples;
//! [`crate::torque`] computes the torques of the played motion there.
//!
//! A periodic motion joins its next period with two continuous derivatives. A motion at rest starts and stops with zero speed.
//! A prescribed end has the velocity from or to the state outside.
//!
//! Planned wheel speeds are means over intervals. The spline therefore passes through the wheel's accumulated **angle**, and
//! the speed is its derivative. The travel over every interval is exactly the planned one.

pub(crate) mod correction;
mod curves;
mod rates;
mod resample;
mod spline;
#[cfg(test)]
mod tests;

pub(crate) use rates::{PlannedContact, Rates};
pub use resample::resample;

use crate::motion::{Ends, Footing};
use crate::plan::{EndEffectorSample, Placement, Plan, Sample};
use crate::problem::state::{ContactFrame, tilt_and_yaw};
use curves::Curves;
use nalgebra::{Complex, DVector, UnitQuaternion, Vector3};
use rollwalk_multibody::euler::{BASE_POSITION, BASE_YAW, EndEffectorPose, JOINTS, Model};
use rollwalk_multibody::rotation;
use rollwalk_robot::{EndEffector, Robot};
use spline::{Jet, Spline};

/// Plan as a function of time.
#[derive(Clone, Debug)]
pub struct PlanSpline {
    model: Model,
    ground: Footing,
    ends: Ends,
    spacing_s: f64,
    duration_s: f64,
    placement: Placement,
    base_xy: Spline,
    /// Splines of base height, yaw, pitch and roll, then of the joint angles.
    pose: Vec<Spline>,
    /// Splines of the corrections of the joints' set-points. Empty for a plan that was not retargeted.
    correction: Vec<Spline>,
    /// Angle of each end effector's wheel motor since the start, rad.
    motor_angle: Vec<Spline>,
    /// Spin angle of each end effector's wheel about its axis since the start, rad.
    wheel_angle: Vec<Spline>,
    /// Flags of the wheels that do not turn relative to their link. Their spin follows from the pose.
    still: Vec<bool>,
    /// Contact flags `[sample][end_effector]`, including the end of the last interval.
    stance: Vec<Vec<bool>>,
    /// Yaw of the wheel axes `[sample][end_effector]`, rad. Yaws between samples are unwrapped to be near these.
    yaw_rad: Vec<Vec<f64>>,
    /// Ground forces `[sample][end_effector]`, including the end of the last interval.
    force_n: Vec<Vec<Vector3<f64>>>,
    /// Torques of joints and of wheel motors at every sample, including the end of the last interval.
    torque_nm: Vec<(Vec<f64>, Vec<Option<f64>>)>,
}

/// Set-points for the controller at one time.
#[derive(Clone, Debug, PartialEq)]
pub struct Setpoints {
    /// Angles of the joints' motors in joint order, rad. They are those of the joints unless motors are coupled. Passive joints
    /// have their planned angle.
    pub joint_rad: Vec<f64>,
    /// Speeds of the joints' motors in joint order, rad/s.
    pub joint_speed_rad_s: Vec<f64>,
    /// Motor speeds of the driven wheels in end-effector order, about the axis in the robot file, rad/s.
    pub motor_speed_rad_s: Vec<f64>,
}

impl Setpoints {
    /// Set-points in channel order: angles of joints with a motor, rad, then speeds of driven wheels, rad/s.
    pub fn channels<'a>(&'a self, robot: &'a Robot) -> impl Iterator<Item = f64> + 'a {
        robot.of_driven_joints(&self.joint_rad).chain(self.motor_speed_rad_s.iter().copied())
    }

    /// Speeds of the motors in channel order, rad/s.
    pub fn speeds_rad_s<'a>(&'a self, robot: &'a Robot) -> impl Iterator<Item = f64> + 'a {
        robot
            .of_driven_joints(&self.joint_speed_rad_s)
            .chain(self.motor_speed_rad_s.iter().copied())
    }
}

impl PlanSpline {
    /// Builds the splines of a validated plan.
    pub fn new(plan: &Plan) -> Self {
        let curves = Curves { plan };
        let base_xy = |s: &Sample| Complex::new(s.base_position_m[0], s.base_position_m[1]);
        let [dx, dy] = plan.end_placement.offset_m;
        let turn = Complex::from_polar(1.0, plan.end_placement.yaw_rad);
        let mut pose = vec![
            curves.scalar(|s| s.base_position_m[2], 0.0),
            curves.scalar(|s| s.base_yaw_pitch_roll_rad[0], plan.end_placement.yaw_rad),
            curves.scalar(|s| s.base_yaw_pitch_roll_rad[1], 0.0),
            curves.scalar(|s| s.base_yaw_pitch_roll_rad[2], 0.0),
        ];
        pose.extend((0..plan.robot.joints.len()).map(|k| curves.scalar(|s| s.joint_rad[k], 0.0)));
        let is_corrected = plan.samples.iter().any(|s| !s.joint_correction_rad.is_empty());
        let of_joint = |s: &Sample, k: usize| s.joint_correction_rad.get(k).copied().unwrap_or(0.0);
        let corrected = if is_corrected { 0..plan.robot.joints.len() } else { 0..0 };
        let correction = corrected.map(|k| curves.scalar(|s| of_joint(s, k), 0.0)).collect();
        let end_effectors = 0..plan.robot.end_effectors.len();
        let angle = |speed: &dyn Fn(&EndEffectorSample) -> f64| {
            end_effectors.clone().map(|j| curves.angle(|s| speed(&s.end_effectors[j]))).collect()
        };
        let mut stance = plan.motion.stance.clone();
        let forces =
            |s: &Sample| s.end_effectors.iter().map(|e| Vector3::from(e.force_n)).collect();
        let mut force_n: Vec<Vec<Vector3<f64>>> = plan.samples.iter().map(forces).collect();
        let torques = |s: &Sample| {
            let motors = s.end_effectors.iter().map(|e| e.motor_torque_nm).collect();
            (s.joint_torque_nm.clone(), motors)
        };
        let mut torque_nm: Vec<_> = plan.samples.iter().map(torques).collect();
        if plan.motion.ends == Ends::Periodic {
            torque_nm.push(torque_nm[0].clone());
            stance.push(stance[0].clone());
            let turned = rotation::yaw_rotation(plan.end_placement.yaw_rad);
            force_n.push(force_n[0].iter().map(|f| turned * f).collect());
        }
        Self {
            model: Model::new(&plan.robot),
            ground: plan.motion.ground.clone(),
            ends: plan.motion.ends,
            spacing_s: plan.sample_interval_s,
            duration_s: plan.motion.duration_s,
            placement: plan.end_placement,
            base_xy: curves.spline(base_xy, turn, Complex::new(dx, dy)),
            pose,
            correction,
            motor_angle: angle(&|e| e.motor_speed_rad_s),
            wheel_angle: angle(&|e| e.wheel_speed_rad_s),
            still: plan.motion.still_wheels(&plan.robot),
            yaw_rad: plan
                .samples
                .iter()
                .map(|s| s.end_effectors.iter().map(|e| e.yaw_rad).collect())
                .collect(),
            stance,
            force_n,
            torque_nm,
        }
    }

    /// Duration of the motion, s. For a periodic motion, its period.
    pub fn duration_s(&self) -> f64 {
        self.duration_s
    }

    /// Returns the model of the plan's robot.
    pub fn model(&self) -> &Model {
        &self.model
    }

    /// Returns the ground of the plan.
    pub(crate) fn ground(&self) -> &Footing {
        &self.ground
    }

    /// Set-points at `plan_time_s`. A periodic motion repeats; other motions stay at their ends.
    pub fn setpoints(&self, plan_time_s: f64) -> Setpoints {
        let (time_s, _) = self.within(plan_time_s);
        let joints: Vec<_> = self.pose[4..].iter().map(|spline| spline.at(time_s)).collect();
        let transmission = self.model.tree().transmission();
        let of_joints = |of: fn(&Jet) -> f64| joints.iter().map(of).collect::<Vec<_>>();
        let (angles, rates) = (of_joints(|jet| jet.value.re), of_joints(|jet| jet.rate.re));
        let mut joint_rad = transmission.motors(&angles);
        let mut joint_speed_rad_s = transmission.at(&angles).motors(&rates);
        for (k, [correction_rad, rate_rad_s]) in self.corrections(time_s).into_iter().enumerate() {
            joint_rad[k] += correction_rad;
            joint_speed_rad_s[k] += rate_rad_s;
        }
        let driven = driven_wheels(self.model.robot());
        Setpoints {
            joint_rad,
            joint_speed_rad_s,
            motor_speed_rad_s: driven.map(|j| self.motor_angle[j].at(time_s).rate.re).collect(),
        }
    }

    /// Corrections of the joints' set-points at `plan_time_s`, rad, and their rates, rad/s. Zero for a plan that was not
    /// retargeted.
    fn corrections(&self, plan_time_s: f64) -> Vec<[f64; 2]> {
        let (time_s, _) = self.within(plan_time_s);
        let of_joint = |spline: &Spline| {
            let correction = spline.at(time_s);
            [correction.value.re, correction.rate.re]
        };
        match self.correction.is_empty() {
            true => vec![[0.0; 2]; self.model.robot().joints.len()],
            false => self.correction.iter().map(of_joint).collect(),
        }
    }

    /// State of the robot at `plan_time_s`, in the plan's world frame. Wheel and motor speeds are instantaneous. Between two
    /// samples, a contact flag is set if both samples are in stance.
    pub fn sample(&self, plan_time_s: f64) -> Sample {
        let (time_s, _) = self.within(plan_time_s);
        Sample { time_s: plan_time_s, ..self.state(time_s, &self.placement(plan_time_s)) }
    }

    /// Placement of the period that contains `plan_time_s`, relative to the first period. Motions that do not repeat have one
    /// period.
    pub(crate) fn placement(&self, plan_time_s: f64) -> Placement {
        self.placement.repeated(self.within(plan_time_s).1)
    }

    /// State of the robot at `time_s` inside the motion, moved by `placement`.
    fn state(&self, time_s: f64, placement: &Placement) -> Sample {
        let xy = self.base_xy.at(time_s).value;
        let free: Vec<f64> = self.pose.iter().map(|spline| spline.at(time_s).value.re).collect();
        let base_position_m = placement.point([xy.re, xy.im, free[0]]);
        let ypr = [free[1] + placement.yaw_rad, free[2], free[3]];
        let joint_rad = free[4..].to_vec();

        let mut q = DVector::zeros(self.model.dofs());
        q.rows_mut(BASE_POSITION, 3).copy_from_slice(&base_position_m);
        q.rows_mut(BASE_YAW, 3).copy_from_slice(&ypr);
        q.rows_mut(JOINTS, joint_rad.len()).copy_from_slice(&joint_rad);
        let pose = self.model.pose(&q);
        let rates: Vec<f64> = self.pose.iter().map(|spline| spline.at(time_s).rate.re).collect();

        let (i, u) = self.interval(time_s);
        let linear = |from: f64, to: f64| from + u * (to - from);
        let [(joints_here, motors_here), (joints_next, motors_next)] =
            [&self.torque_nm[i], &self.torque_nm[i + 1]];
        let end_effectors = self
            .model
            .robot()
            .end_effectors
            .iter()
            .enumerate()
            .map(|(j, end_effector)| {
                let mount = &pose.end_effectors[j];
                let radius_m = end_effector.radius_m;
                let angles = end_effector.contact.rolls().then(|| {
                    let near = self.yaw_rad[i][j] + placement.yaw_rad;
                    tilt_and_yaw(&mount.axis, near).into()
                });
                let stands = self.stands(i, u, j);
                let map = self.ground.contact(j, stands, &mount.center);
                let frame = ContactFrame::below(radius_m, angles, &map, &mount.center);
                let [tilt_rad, yaw_rad] = angles.unwrap_or_default();
                let force = self.force_n[i][j].lerp(&self.force_n[i + 1][j], u);
                EndEffectorSample {
                    contact: stands,
                    position_m: (mount.center + frame.to_contact).into(),
                    force_n: placement.vector(force.into()),
                    wheel_speed_rad_s: if self.still[j] {
                        self.spin_with_link(j, mount, &rates)
                    } else {
                        self.wheel_angle[j].at(time_s).rate.re
                    },
                    motor_speed_rad_s: self.motor_angle[j].at(time_s).rate.re,
                    motor_torque_nm: motors_here[j]
                        .zip(motors_next[j])
                        .map(|(from, to)| linear(from, to)),
                    tilt_rad,
                    yaw_rad,
                }
            })
            .collect();
        Sample {
            time_s,
            base_position_m,
            base_yaw_pitch_roll_rad: ypr,
            base_orientation_wxyz: quaternion_wxyz(ypr),
            joint_rad,
            joint_correction_rad: self.correction.iter().map(|c| c.at(time_s).value.re).collect(),
            joint_torque_nm: joints_here
                .iter()
                .zip(joints_next)
                .map(|(&from, &to)| linear(from, to))
                .collect(),
            com_m: pose.com.into(),
            end_effectors,
        }
    }

    /// Angle of every end effector's wheel motor since the start of the motion, rad; 0 without a wheel.
    pub fn motor_angles_rad(&self, plan_time_s: f64) -> Vec<f64> {
        let (time_s, periods) = self.within(plan_time_s);
        let angle = |spline: &Spline| {
            let period = spline.at(self.duration_s).value.re;
            spline.at(time_s).value.re + periods as f64 * period
        };
        self.motor_angle.iter().map(angle).collect()
    }

    /// Index of the interval that contains `time_s`, and the elapsed fraction of this interval.
    fn interval(&self, time_s: f64) -> (usize, f64) {
        let position = time_s / self.spacing_s;
        let i = (position.floor().max(0.0) as usize).min(self.force_n.len() - 2);
        (i, (position - i as f64).clamp(0.0, 1.0))
    }

    /// Returns true if end effector `j` is in stance at fraction `u` of interval `i`.
    fn stands(&self, i: usize, u: f64, j: usize) -> bool {
        /// Tolerance for a time to coincide with a sample, as a fraction of the interval.
        const ON_SAMPLE: f64 = 1e-9;
        (u > 1.0 - ON_SAMPLE || self.stance[i][j]) && (u < ON_SAMPLE || self.stance[i + 1][j])
    }

    /// Spin ω of a wheel that is fixed to its link, rad/s: Ω·a − α̇_yaw (v·a), the link's rotation about the axis minus the yaw
    /// rate of the axis. `rates` are the rates of the pose splines.
    fn spin_with_link(&self, j: usize, mount: &EndEffectorPose, rates: &[f64]) -> f64 {
        // Translation does not turn a link; the splines of the pose contain height and attitude of the base.
        let dofs = self.model.chain(j).dofs.iter().zip(&mount.d_rotation).skip(3);
        let turn: Vector3<f64> = dofs.map(|(&dof, axis)| axis * rates[dof - BASE_YAW + 1]).sum();
        let axis = mount.axis;
        let d_axis = turn.cross(&axis);
        let yaw_rate =
            (axis.x * d_axis.y - axis.y * d_axis.x) / (axis.x * axis.x + axis.y * axis.y);
        turn.dot(&axis) - yaw_rate * axis.z
    }

    /// Mean wheel and motor speed of end effector `j` between two times inside the motion, rad/s.
    fn mean_speeds(&self, j: usize, from_s: f64, to_s: f64) -> (f64, f64) {
        let mean = |angle: &Spline| {
            (angle.at(to_s).value.re - angle.at(from_s).value.re) / (to_s - from_s)
        };
        if self.still[j] {
            // Simpson's rule gives the mean of the spin that follows from the pose.
            let spin = |time_s: f64| {
                self.state(time_s, &Placement::default()).end_effectors[j].wheel_speed_rad_s
            };
            let wheel = (spin(from_s) + 4.0 * spin(0.5 * (from_s + to_s)) + spin(to_s)) / 6.0;
            return (wheel, 0.0);
        }
        (mean(&self.wheel_angle[j]), mean(&self.motor_angle[j]))
    }

    /// Converts `plan_time_s` to a time inside the motion, s, and a number of periods.
    fn within(&self, plan_time_s: f64) -> (f64, i64) {
        match self.ends {
            Ends::Periodic => {
                let periods = (plan_time_s / self.duration_s).floor();
                (plan_time_s - periods * self.duration_s, periods as i64)
            }
            Ends::AtRest | Ends::Prescribed => (plan_time_s.clamp(0.0, self.duration_s), 0),
        }
    }
}

/// Indices of the end effectors whose wheel has a motor, in channel order.
pub fn driven_wheels(robot: &Robot) -> impl Iterator<Item = usize> + '_ {
    let driven = |(_, e): &(usize, &EndEffector)| e.contact.actuator().is_some();
    robot.end_effectors.iter().enumerate().filter(driven).map(|(j, _)| j)
}

/// World-from-body rotation of intrinsic yaw, pitch and roll, `[w, x, y, z]`.
///
/// Yaw, pitch and roll are unwrapped. Their half angles make the sign continuous along a motion.
fn quaternion_wxyz([yaw, pitch, roll]: [f64; 3]) -> [f64; 4] {
    let about = |axis, angle| *UnitQuaternion::from_axis_angle(axis, angle).quaternion();
    let q = about(&Vector3::z_axis(), yaw)
        * about(&Vector3::y_axis(), pitch)
        * about(&Vector3::x_axis(), roll);
    [q.w, q.i, q.j, q.k]
}
