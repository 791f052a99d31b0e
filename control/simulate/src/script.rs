//! Script of a plan for a simulated robot: its start state, and the control law of each motor.

use nalgebra::{Matrix3, Quaternion, Rotation3, UnitQuaternion, Vector3};
use rollwalk_multibody::rotation::log;
use rollwalk_physics::motor::Law;
use rollwalk_physics::world::RobotState;
use rollwalk_planner::motion::Ends;
use rollwalk_planner::plan::{Plan, Sample};
use rollwalk_planner::sample::PlanSpline;
use rollwalk_robot::{Channel, Robot};

/// Duration of the rest before and after a finite motion, s.
pub(crate) const REST_S: f64 = 1.0;

/// Half of the interval of the finite differences for velocities at the start, s.
const INSTANT_S: f64 = 1e-4;

/// Plan that can be evaluated at any time.
pub struct Script<'a> {
    plan: &'a Plan,
    spline: PlanSpline,
    feed_forward: bool,
}

impl<'a> Script<'a> {
    /// Creates the script of a validated plan. `feed_forward` adds the planned torques to the control laws.
    pub fn new(plan: &'a Plan, feed_forward: bool) -> Self {
        Self { plan, spline: PlanSpline::new(plan), feed_forward }
    }

    /// Plan of the script.
    pub fn plan(&self) -> &'a Plan {
        self.plan
    }

    /// Robot of the plan.
    pub fn robot(&self) -> &'a Robot {
        &self.plan.robot
    }

    /// True if the motion repeats.
    pub fn repeats(&self) -> bool {
        self.plan.motion.ends == Ends::Periodic
    }

    /// True if end effectors leave the ground, so that steps can catch the robot.
    pub fn steps(&self) -> bool {
        self.plan.motion.stance.iter().any(|row| row.iter().any(|&stands| !stands))
    }

    /// Duration of a finite motion or of a period, s.
    pub fn duration_s(&self) -> f64 {
        self.spline.duration_s()
    }

    /// Planned position of the body's origin, m, and world-from-body rotation at `time_s` of the motion.
    pub fn base(&self, time_s: f64) -> (Vector3<f64>, Matrix3<f64>) {
        base(&self.spline.sample(time_s))
    }

    /// Planned joint angles at `time_s` of the motion, rad.
    pub fn joint_rad(&self, time_s: f64) -> Vec<f64> {
        self.spline.sample(time_s).joint_rad
    }

    /// Planned centre of mass at `time_s` of the motion, m. Times of a periodic motion continue over all periods.
    pub fn com(&self, time_s: f64) -> Vector3<f64> {
        self.spline.sample(time_s).com_m.into()
    }

    /// Planned joint torques at `time_s` of the motion, N·m.
    pub fn joint_torques_nm(&self, time_s: f64) -> Vec<f64> {
        self.spline.sample(time_s).joint_torque_nm
    }

    /// Planned start state on ground that is rotated by `world_from_plan`. A periodic motion begins at its speed, a finite one
    /// at rest.
    pub fn start(&self, world_from_plan: &Rotation3<f64>) -> RobotState {
        let robot = self.robot();
        let first = self.spline.sample(0.0);
        let (position, rotation) = base(&first);
        let mut state = RobotState {
            world_from_body: rotation,
            joint_rad: first.joint_rad,
            ..RobotState::nominal(robot, position)
        };
        if self.repeats() {
            let [before, after] = [-INSTANT_S, INSTANT_S].map(|t| base(&self.spline.sample(t)));
            let per_s = 1.0 / (2.0 * INSTANT_S);
            state.base_velocity_m_s = (after.0 - before.0) * per_s;
            state.base_spin_rad_s = log(&(after.1 * before.1.transpose())) * per_s;
            let [before, after] = [-INSTANT_S, INSTANT_S].map(|t| self.spline.sample(t).joint_rad);
            state.joint_rad_s = after.iter().zip(before).map(|(a, b)| (a - b) * per_s).collect();
            let planned = first.end_effectors.iter().zip(&robot.end_effectors);
            let speeds = planned.map(|(sample, end_effector)| {
                match end_effector.contact.actuator() {
                    Some(_) => sample.motor_speed_rad_s,
                    // The spin of a free wheel about its axis, without the spin of its link, is close to its total spin.
                    None if end_effector.contact.freewheels() => sample.wheel_speed_rad_s,
                    None => 0.0,
                }
            });
            state.wheel_rad_s = speeds.collect();
        }
        state.base_position_m = world_from_plan * state.base_position_m;
        state.world_from_body = world_from_plan.matrix() * state.world_from_body;
        state.base_velocity_m_s = world_from_plan * state.base_velocity_m_s;
        state.base_spin_rad_s = world_from_plan * state.base_spin_rad_s;
        state
    }

    /// Control law of each motor at `time_s` of the motion, in channel order. Gains and limits are those of the robot file. On
    /// buses that carry no speed of joints, servos brake towards rest, and lag.
    pub fn laws(&self, time_s: f64) -> Vec<Law> {
        let setpoints = self.spline.setpoints(time_s);
        let sample = self.spline.sample(time_s);
        let share = f64::from(u8::from(self.feed_forward));
        let joints = self.robot().driven_joints().map(|number| {
            let [position, speed, torque] = [
                setpoints.joint_rad[number],
                setpoints.joint_speed_rad_s[number],
                sample.joint_torque_nm[number],
            ];
            (position, speed, torque)
        });
        let motors = sample.end_effectors.iter().filter_map(|of| of.motor_torque_nm);
        let wheels = setpoints.motor_speed_rad_s.iter().zip(motors);
        let wheels = wheels.map(|(&speed, torque)| (0.0, speed, torque));
        let rest = if self.repeats() { 1.0 } else { self.moves(time_s) };
        let speed_part = |channel: &Channel<'_>| match self.robot().takes_speed(channel) {
            true => rest,
            false => 0.0,
        };
        self.robot()
            .channels()
            .zip(joints.chain(wheels))
            .map(|(channel, (position_rad, speed, torque))| Law {
                position_rad,
                speed_rad_s: speed_part(&channel) * speed,
                torque_nm: share * torque,
                ..servo(&channel)
            })
            .collect()
    }

    /// Returns 1 during a finite motion; 0 before and after it, when the robot holds its end pose.
    fn moves(&self, time_s: f64) -> f64 {
        f64::from(u8::from(time_s > 0.0 && time_s < self.duration_s()))
    }
}

/// Control law of a channel at rest, with the gains and limits of the robot file.
pub(crate) fn servo(channel: &Channel<'_>) -> Law {
    let law = Law::servo(channel.actuator());
    match channel {
        Channel::Joint(_) => law,
        Channel::Wheel(..) => Law { kp_nm_rad: 0.0, ..law },
    }
}

/// Position of the body's origin, m, and world-from-body rotation of a sample.
fn base(sample: &Sample) -> (Vector3<f64>, Matrix3<f64>) {
    let [w, x, y, z] = sample.base_orientation_wxyz;
    let rotation = UnitQuaternion::from_quaternion(Quaternion::new(w, x, y, z));
    (sample.base_position_m.into(), rotation.to_rotation_matrix().into_inner())
}
