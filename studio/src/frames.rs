//! Frames of a plan at a rate: poses of all bodies, contacts and forces, joints and wheels.

use crate::messages::{Columns, FramesHeader, Period};
use crate::scene::{poses, turning_wheels};
use nalgebra::{Quaternion, UnitQuaternion, Vector3};
use rollwalk_multibody::{Configuration, Frames, Tree};
use rollwalk_planner::motion::Ends;
use rollwalk_planner::plan::{Plan, Sample};
use rollwalk_planner::sample::{PlanSpline, Setpoints, driven_wheels};

/// Range of the frame rate, Hz.
pub const RATES_HZ: std::ops::RangeInclusive<f64> = 1.0..=1000.0;

/// Header and bytes of the frames of a plan.
pub fn frames(plan: &Plan, rate_hz: f64) -> (FramesHeader, Vec<u8>) {
    let robot = &plan.robot;
    let (spline, tree) = (PlanSpline::new(plan), Tree::new(robot));
    let bodies = robot.links.len() + turning_wheels(robot).count();
    let com = 7 * bodies;
    let end_effectors = com + 3;
    let joints = end_effectors + 7 * robot.end_effectors.len();
    let wheels = joints + 3 * robot.joints.len();
    let width = wheels + 2 * driven_wheels(robot).count();
    let columns = Columns { bodies: 0, com, end_effectors, joints, wheels };
    let duration_s = plan.motion.duration_s;
    let periodic = plan.motion.ends == Ends::Periodic;
    // A whole number of rows still counts if rounding made it slightly shorter. A period ends where the next begins.
    let last = (duration_s * rate_hz + 1e-6).floor();
    let repeats = periodic && last + 1e-3 > duration_s * rate_hz;
    let count = last as usize + usize::from(!repeats);
    let mut bytes = Vec::with_capacity(4 * width * count);
    let mut state = None;
    for row in 0..count {
        let time_s = (row as f64 / rate_hz).min(duration_s);
        let (sample, setpoints) = (spline.sample(time_s), spline.setpoints(time_s));
        let [w, i, j, k] = sample.base_orientation_wxyz;
        let rotation = UnitQuaternion::from_quaternion(Quaternion::new(w, i, j, k));
        let at = Configuration {
            base_position_m: Vector3::from(sample.base_position_m),
            world_from_body: rotation.to_rotation_matrix().into_inner(),
            joint_rad: &sample.joint_rad,
        };
        let frames = state.get_or_insert_with(|| Frames::new(&tree, &at));
        frames.update(&tree, &at);
        let mut put = |value: f64| bytes.extend_from_slice(&(value as f32).to_le_bytes());
        poses(robot, frames, &spline.motor_angles_rad(time_s)).flatten().for_each(&mut put);
        rest(plan, &sample, &setpoints, &mut put);
    }
    let placement = plan.end_placement;
    let period =
        periodic.then_some(Period { offset_m: placement.offset_m, yaw_rad: placement.yaw_rad });
    (FramesHeader { count, rate_hz, duration_s, period, width, columns }, bytes)
}

/// Writes the columns after the poses.
fn rest(plan: &Plan, sample: &Sample, setpoints: &Setpoints, put: &mut impl FnMut(f64)) {
    sample.com_m.into_iter().for_each(&mut *put);
    for foot in &sample.end_effectors {
        put(f64::from(u8::from(foot.contact)));
        foot.position_m.into_iter().chain(foot.force_n).for_each(&mut *put);
    }
    for (k, &angle_rad) in sample.joint_rad.iter().enumerate() {
        put(angle_rad);
        put(setpoints.joint_speed_rad_s[k]);
        put(sample.joint_torque_nm[k]);
    }
    for (j, &speed_rad_s) in driven_wheels(&plan.robot).zip(&setpoints.motor_speed_rad_s) {
        put(speed_rad_s);
        put(sample.end_effectors[j].motor_torque_nm.unwrap_or(0.0));
    }
}
