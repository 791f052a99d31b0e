//! Keyframes: state of the robot with the controls of its servos.

use super::order::Order;
use crate::bodies::{Blades, bodies};
use crate::xml::numbers;
use nalgebra::Isometry3;
use rollwalk_multibody::{Standing, State, Tree};
use rollwalk_planner::export::Rate;
use rollwalk_planner::plan::Plan;
use rollwalk_planner::sample::PlanSpline;
use rollwalk_planner::whole_body::WholeBody;
use rollwalk_robot::Robot;

/// A state of a model.
pub struct Keyframe {
    name: String,
    time_s: f64,
    /// Generalised positions, in the order of MuJoCo.
    qpos: Vec<f64>,
    qvel: Vec<f64>,
    /// Controls, in channel order.
    ctrl: Vec<f64>,
}

impl Keyframe {
    /// Attributes of the `key` element.
    pub fn attributes(&self) -> [(&'static str, String); 5] {
        [
            ("name", self.name.clone()),
            ("time", self.time_s.to_string()),
            ("qpos", numbers(&self.qpos)),
            ("qvel", numbers(&self.qvel)),
            ("ctrl", numbers(&self.ctrl)),
        ]
    }
}

/// Keyframe of the robot in its nominal standing pose, with controls that hold it; `None` if a wheel lies flat.
pub fn standing(robot: &Robot) -> Option<Keyframe> {
    let tree = Tree::new(robot);
    let standing = Standing::new(&tree)?;
    let mut state = State::nominal(&tree);
    state.base_position_m = standing.frames.link_origins[0];
    let order = Order::new(robot, &bodies(robot, &[], Blades::Roll));
    let still = vec![0.0; robot.end_effectors.len()];
    let motors = robot.end_effectors.iter().filter_map(|foot| foot.contact.actuator());
    Some(Keyframe {
        name: "stand".into(),
        time_s: 0.0,
        qpos: order.positions(&state, [1.0, 0.0, 0.0, 0.0], &still),
        qvel: order.velocities(&state, &still),
        ctrl: controls(
            robot,
            &robot.transmission().motors(&state.joint_rad),
            &vec![0.0; robot.joints.len()],
            &vec![0.0; motors.count()],
            &robot.of_driven_joints(&standing.torque_nm).collect::<Vec<_>>(),
        ),
    })
}

/// Keyframes of a plan from beginning to end.
pub fn keyframes(plan: &Plan, rate: Rate) -> Vec<Keyframe> {
    let order = Order::new(&plan.robot, &bodies(&plan.robot, &[], Blades::Roll));
    let (spline, mut whole) = (PlanSpline::new(plan), WholeBody::new(plan));
    let frame = |(number, time_s): (usize, f64)| {
        let state = whole.at(time_s, &Isometry3::identity()).state;
        // After the end of a periodic motion, its first set-points follow.
        let (setpoints, torques_nm) = whole.setpoints(time_s);
        let sample = spline.sample(time_s);
        let feet = sample.end_effectors.iter();
        let speeds: Vec<_> = feet.map(|foot| foot.motor_speed_rad_s).collect();
        Keyframe {
            name: format!("{}_{number:04}", plan.motion.name),
            time_s,
            qpos: order.positions(
                &state,
                sample.base_orientation_wxyz,
                &spline.motor_angles_rad(time_s),
            ),
            qvel: order.velocities(&state, &speeds),
            ctrl: controls(
                &plan.robot,
                &setpoints.joint_rad,
                &setpoints.joint_speed_rad_s,
                &setpoints.motor_speed_rad_s,
                &torques_nm,
            ),
        }
    };
    rate.times_s(plan.motion.duration_s).enumerate().map(frame).collect()
}

/// Controls of servos, rad, and of drives, rad/s. Each control is the set-point plus an offset, through which the model's
/// servo adds set-point speed and feed-forward torque. Torques are in channel order.
fn controls(
    robot: &Robot,
    joint_rad: &[f64],
    joint_rad_s: &[f64],
    motor_rad_s: &[f64],
    torques_nm: &[f64],
) -> Vec<f64> {
    let offset = |torque_nm: f64, gain: f64| if gain > 0.0 { torque_nm / gain } else { 0.0 };
    let joints = robot.driven_joints().zip(torques_nm).map(|(k, torque_nm)| {
        let motor = &robot.joints[k].actuator;
        let feed_forward_nm = motor.kd_nm_s_rad * joint_rad_s[k] + torque_nm;
        joint_rad[k] + offset(feed_forward_nm, motor.kp_nm_rad)
    });
    let motors = robot.end_effectors.iter().filter_map(|foot| foot.contact.actuator());
    let torques = torques_nm[robot.driven_joints().count()..].iter().chain(std::iter::repeat(&0.0));
    let wheels = motors.zip(motor_rad_s).zip(torques);
    let wheels =
        wheels.map(|((motor, speed), torque_nm)| speed + offset(*torque_nm, motor.kd_nm_s_rad));
    joints.chain(wheels).collect()
}
