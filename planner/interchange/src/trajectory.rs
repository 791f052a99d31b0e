//! Plan as JSON in the form of the ROS message `moveit_msgs/RobotTrajectory`: a `trajectory_msgs/JointTrajectory` of joints
//! and driven wheels, and a `trajectory_msgs/MultiDOFJointTrajectory` of the body.
//!
//! Fields have the names and units of the messages (rad, rad/s, N·m, and m, m/s, N for prismatic joints; quaternions with w
//! last), so that a node can copy the object into a message.

use crate::bodies::{WORLD, joint_names};
use nalgebra::Isometry3;
use rollwalk_multibody::{ANGULAR, LINEAR};
use rollwalk_planner::export::Rate;
use rollwalk_planner::plan::Plan;
use rollwalk_planner::sample::{PlanSpline, driven_wheels};
use rollwalk_planner::whole_body::WholeBody;
use serde::Serialize;

#[derive(Serialize)]
struct RobotTrajectory {
    joint_trajectory: Trajectory<JointPoint>,
    multi_dof_joint_trajectory: Trajectory<BasePoint>,
}

#[derive(Serialize)]
struct Trajectory<P> {
    header: Header,
    joint_names: Vec<String>,
    points: Vec<P>,
}

#[derive(Clone, Serialize)]
struct Header {
    stamp: Duration,
    frame_id: String,
}

#[derive(Clone, Copy, Serialize)]
struct Duration {
    sec: i32,
    nanosec: u32,
}

#[derive(Serialize)]
struct JointPoint {
    positions: Vec<f64>,
    velocities: Vec<f64>,
    effort: Vec<f64>,
    time_from_start: Duration,
}

#[derive(Serialize)]
struct BasePoint {
    transforms: [Transform; 1],
    velocities: [Twist; 1],
    time_from_start: Duration,
}

#[derive(Serialize)]
struct Transform {
    translation: Xyz,
    rotation: Xyzw,
}

#[derive(Serialize)]
struct Twist {
    linear: Xyz,
    angular: Xyz,
}

#[derive(Serialize)]
struct Xyz {
    x: f64,
    y: f64,
    z: f64,
}

#[derive(Serialize)]
struct Xyzw {
    x: f64,
    y: f64,
    z: f64,
    w: f64,
}

/// Trajectory of a plan from beginning to end. Positions of driven wheels are angles since the beginning.
pub fn trajectory(plan: &Plan, rate: Rate) -> String {
    let robot = &plan.robot;
    let (spline, mut whole) = (PlanSpline::new(plan), WholeBody::new(plan));
    let transmission = robot.transmission();
    let (mut joints, mut base) = (Vec::new(), Vec::new());
    for time_s in rate.times_s(plan.motion.duration_s) {
        let time_from_start = duration(time_s);
        let (setpoints, motors_nm) = whole.setpoints(time_s);
        let (of_joints, of_wheels) = motors_nm.split_at(robot.driven_joints().count());
        let mut all_nm = vec![0.0; robot.joints.len()];
        robot
            .driven_joints()
            .zip(of_joints)
            .for_each(|(joint, torque_nm)| all_nm[joint] = *torque_nm);
        let joint_rad = transmission.joints(&setpoints.joint_rad);
        let ratios = transmission.at(&joint_rad);
        let all_nm = ratios.joint_torques(&all_nm);
        let joints_nm = robot.of_driven_joints(&all_nm);
        let per_rad = || robot.driven_joints().map(|joint| robot.joints[joint].per_rad());
        let joints_effort = joints_nm.zip(per_rad()).map(|(torque, per_rad)| torque / per_rad);
        let effort = joints_effort.chain(of_wheels.iter().copied()).collect();
        let in_unit = |of_joints: &[f64]| -> Vec<f64> {
            robot.of_driven_joints(of_joints).zip(per_rad()).map(|(of, per)| of * per).collect()
        };
        let speeds = in_unit(&ratios.joints(&setpoints.joint_speed_rad_s));
        let angles = spline.motor_angles_rad(time_s);
        let wheels = driven_wheels(robot).map(|wheel| angles[wheel]);
        joints.push(JointPoint {
            velocities: speeds.into_iter().chain(setpoints.motor_speed_rad_s).collect(),
            positions: in_unit(&joint_rad).into_iter().chain(wheels).collect(),
            effort,
            time_from_start,
        });
        let state = whole.at(time_s, &Isometry3::identity()).state;
        let [w, x, y, z] = spline.sample(time_s).base_orientation_wxyz;
        base.push(BasePoint {
            transforms: [Transform {
                translation: xyz(state.base_position_m.as_slice()),
                rotation: Xyzw { x, y, z, w },
            }],
            velocities: [Twist {
                linear: xyz(&state.velocity[LINEAR..]),
                angular: xyz(&state.velocity[ANGULAR..]),
            }],
            time_from_start,
        });
    }
    let header = Header { stamp: duration(0.0), frame_id: WORLD.to_owned() };
    let body = robot.links[0].name.clone();
    let all = RobotTrajectory {
        joint_trajectory: Trajectory {
            header: header.clone(),
            joint_names: joint_names(robot),
            points: joints,
        },
        multi_dof_joint_trajectory: Trajectory { header, joint_names: vec![body], points: base },
    };
    // Only maps with non-string keys cannot become JSON, and there is none.
    serde_json::to_string(&all).unwrap_or_default() + "\n"
}

fn duration(time_s: f64) -> Duration {
    let nanoseconds = (time_s * 1e9).round() as i64;
    Duration {
        sec: (nanoseconds / 1_000_000_000) as i32,
        nanosec: (nanoseconds % 1_000_000_000) as u32,
    }
}

/// The first three numbers.
fn xyz(v: &[f64]) -> Xyz {
    Xyz { x: v[0], y: v[1], z: v[2] }
}
