//! Motion data for learning: a plan at a fixed rate as an `.npz` file, in the layout that the tracking tasks of mjlab and
//! Isaac Lab read, with torques, contacts and forces.
//!
//! Bodies and joints are those of the MJCF model in its order, without the world and the free joint. The file contains the
//! model, so that it needs no other file. `docs/training-data.md` lists the arrays.

use crate::bodies::{Blades, bodies};
use crate::mjcf::order::Order;
use crate::mjcf::{channels, model_of};
use crate::npz::Npz;
use nalgebra::{Isometry3, Quaternion, Translation3, UnitQuaternion, Vector3};
use rollwalk_multibody::{ANGULAR, LINEAR};
use rollwalk_planner::export::{Length, Rate};
use rollwalk_planner::plan::Plan;
use rollwalk_planner::sample::PlanSpline;
use rollwalk_planner::whole_body::{Instant, WholeBody};
use std::io;

/// Coordinates of the free joint in the positions and velocities of a model.
const BASE_POSITIONS: usize = 7;
const BASE_VELOCITIES: usize = 6;
/// Numbers of a body in a frame: position, quaternion and velocities.
const BODY_NUMBERS: usize = 13;
/// Maximum number of 4-byte numbers in a file of 4 GiB.
const NUMBERS_MAX: usize = 1 << 30;

/// Motion data of a plan as an `.npz` file. Frames are at multiples of 1/rate. Without a length, the data have the duration of
/// the plan.
///
/// # Errors
/// Returns an error if the file would exceed 4 GiB.
pub fn motion_data(plan: &Plan, rate: Rate, length: Option<Length>) -> io::Result<Vec<u8>> {
    let robot = &plan.robot;
    let model = bodies(robot, &[], Blades::Roll);
    let order = Order::new(robot, &model);
    let count = frame_count(plan, rate, length);
    // About thirteen numbers a body, as many as a free body has positions and velocities.
    if count.saturating_mul(BODY_NUMBERS * model.len()) > NUMBERS_MAX {
        return Err(io::Error::other(format!(
            "{count} frames of {} bodies exceed 4 GiB: choose a smaller --rate or --length",
            model.len()
        )));
    }
    let mut rolling = RollingPlan::new(plan);
    let mut frames = Frames::default();
    for time_s in times_s(plan, rate, length) {
        frames.add(&order, &rolling.at(time_s));
    }
    let base = std::iter::once(model[0].name.as_str());
    let body_names: Vec<_> = base.chain(order.hinged.iter().map(|of| &*of.body)).collect();
    let joint_names: Vec<_> = order.hinged.iter().map(|of| &*of.joint).collect();
    let motors = channels(robot, &model).filter(|hinge| hinge.of.actuator().is_some());
    let motor_names: Vec<_> = motors.map(|hinge| &*hinge.name).collect();
    let feet: Vec<_> = robot.end_effectors.iter().map(|foot| &*foot.name).collect();
    let Frames { count: t, .. } = frames;
    let (b, j, m, e) = (body_names.len(), joint_names.len(), motor_names.len(), feet.len());
    let mut file = Npz::default();
    file.floats("fps", &[1], &[rate.hz()])?;
    file.texts("joint_names", &joint_names)?;
    file.texts("body_names", &body_names)?;
    file.floats("joint_pos", &[t, j], &frames.joint_pos)?;
    file.floats("joint_vel", &[t, j], &frames.joint_vel)?;
    file.floats("body_pos_w", &[t, b, 3], &frames.body_pos)?;
    file.floats("body_quat_w", &[t, b, 4], &frames.body_quat)?;
    file.floats("body_lin_vel_w", &[t, b, 3], &frames.body_lin_vel)?;
    file.floats("body_ang_vel_w", &[t, b, 3], &frames.body_ang_vel)?;
    file.texts("motor_names", &motor_names)?;
    file.floats("motor_torque_nm", &[t, m], &frames.motor_torque_nm)?;
    file.texts("end_effector_names", &feet)?;
    file.flags("contact", &[t, e], &frames.contact)?;
    file.floats("contact_force_n", &[t, e, 3], &frames.contact_force_n)?;
    file.texts("mjcf", &[&model_of(plan)?])?;
    file.finish()
}

/// Number of frames.
fn frame_count(plan: &Plan, rate: Rate, length: Option<Length>) -> usize {
    let length_s = length.map_or(plan.motion.duration_s, |length| length.of(&plan.motion));
    // Whole intervals that rounding left a hair short still count.
    (length_s * rate.hz() + 1e-6).floor() as usize + 1
}

/// Times of the frames, s.
fn times_s(plan: &Plan, rate: Rate, length: Option<Length>) -> impl Iterator<Item = f64> + use<> {
    (0..frame_count(plan, rate, length)).map(move |frame| frame as f64 / rate.hz())
}

/// Arrays of all frames, one row after the other.
#[derive(Default)]
struct Frames {
    count: usize,
    joint_pos: Vec<f64>,
    joint_vel: Vec<f64>,
    body_pos: Vec<f64>,
    body_quat: Vec<f64>,
    body_lin_vel: Vec<f64>,
    body_ang_vel: Vec<f64>,
    motor_torque_nm: Vec<f64>,
    contact: Vec<bool>,
    contact_force_n: Vec<f64>,
}

impl Frames {
    fn add(&mut self, order: &Order, frame: &Frame) {
        let Frame { instant, wxyz, wheel_rad, wheel_rad_s, torque_nm } = frame;
        let positions = order.positions(&instant.state, *wxyz, wheel_rad);
        let velocities = order.velocities(&instant.state, wheel_rad_s);
        let [w, x, y, z] = *wxyz;
        let velocity = &instant.state.velocity;
        let mut poses = vec![Moving {
            world_from_body: Isometry3::from_parts(
                instant.state.base_position_m.into(),
                UnitQuaternion::new_unchecked(Quaternion::new(w, x, y, z)),
            ),
            linear_m_s: Vector3::from_column_slice(&velocity[LINEAR..LINEAR + 3]),
            angular_rad_s: Vector3::from_column_slice(&velocity[ANGULAR..ANGULAR + 3]),
        }];
        let [angles, speeds] = [&positions[BASE_POSITIONS..], &velocities[BASE_VELOCITIES..]];
        for ((hinged, angle), speed) in order.hinged.iter().zip(angles).zip(speeds) {
            let parent = &poses[hinged.parent];
            let slides = hinged.travel_m_per_rad.is_some();
            let moved = match slides {
                true => Translation3::from(hinged.axis.scale(*angle)).into(),
                false => {
                    let angle_rad = angle - hinged.zero_rad;
                    let turn = UnitQuaternion::from_axis_angle(&hinged.axis, angle_rad);
                    Isometry3::from_parts(Translation3::identity(), turn)
                }
            };
            let pose = parent.world_from_body * hinged.parent_from_body * moved;
            let lever = pose.translation.vector - parent.world_from_body.translation.vector;
            let along = pose.rotation * hinged.axis.scale(*speed);
            let (slide, turn) = match slides {
                true => (along, Vector3::zeros()),
                false => (Vector3::zeros(), along),
            };
            poses.push(Moving {
                linear_m_s: parent.linear_m_s + parent.angular_rad_s.cross(&lever) + slide,
                angular_rad_s: parent.angular_rad_s + turn,
                world_from_body: pose,
            });
        }
        self.count += 1;
        self.joint_pos.extend(angles);
        self.joint_vel.extend(speeds);
        for Moving { world_from_body, linear_m_s, angular_rad_s } in &poses {
            let q = world_from_body.rotation.quaternion();
            self.body_pos.extend(world_from_body.translation.vector.iter());
            self.body_quat.extend([q.w, q.i, q.j, q.k]);
            self.body_lin_vel.extend(linear_m_s.iter());
            self.body_ang_vel.extend(angular_rad_s.iter());
        }
        self.motor_torque_nm.extend(torque_nm);
        self.contact.extend(&instant.stands);
        self.contact_force_n.extend(instant.force_n.iter().flat_map(|force| force.iter()));
    }
}

/// Pose of a body in the world, and velocity of its origin in world axes.
struct Moving {
    world_from_body: Isometry3<f64>,
    linear_m_s: Vector3<f64>,
    angular_rad_s: Vector3<f64>,
}

/// State of the robot in one frame.
struct Frame {
    instant: Instant,
    /// World-from-body rotation of the base; its sign is continuous along a motion.
    wxyz: [f64; 4],
    /// Angle of each end effector's wheel relative to its link, rad; 0 without a wheel that spins.
    wheel_rad: Vec<f64>,
    wheel_rad_s: Vec<f64>,
    /// Torques in channel order, N·m.
    torque_nm: Vec<f64>,
}

/// Plan with the angles of free wheels, which plans do not contain: the integral of their speed from frame to frame.
struct RollingPlan {
    spline: PlanSpline,
    whole: WholeBody,
    /// Indices of the end effectors with free wheels.
    free: Vec<usize>,
    /// Time of the latest frame, s, with the angles and speeds of the wheels at that time.
    time_s: f64,
    wheel_rad: Vec<f64>,
    wheel_rad_s: Vec<f64>,
}

impl RollingPlan {
    fn new(plan: &Plan) -> Self {
        let mut whole = WholeBody::new(plan);
        let feet = plan.robot.end_effectors.iter().enumerate();
        let free = feet.filter(|(_, foot)| foot.contact.freewheels()).map(|(k, _)| k);
        let wheel_rad_s = speeds(&mut whole, 0.0).1;
        Self {
            spline: PlanSpline::new(plan),
            free: free.collect(),
            time_s: 0.0,
            wheel_rad: vec![0.0; wheel_rad_s.len()],
            wheel_rad_s,
            whole,
        }
    }

    /// Frame at a time, which is not before the last frame.
    fn at(&mut self, time_s: f64) -> Frame {
        let (instant, after) = speeds(&mut self.whole, time_s);
        let mut wheel_rad = self.spline.motor_angles_rad(time_s);
        let interval_s = time_s - self.time_s;
        if !self.free.is_empty() && interval_s > 0.0 {
            let middle = speeds(&mut self.whole, self.time_s + 0.5 * interval_s).1;
            for &wheel in &self.free {
                // Simpson's rule.
                let mean = (self.wheel_rad_s[wheel] + 4.0 * middle[wheel] + after[wheel]) / 6.0;
                self.wheel_rad[wheel] += interval_s * mean;
            }
        }
        for &wheel in &self.free {
            wheel_rad[wheel] = self.wheel_rad[wheel];
        }
        (self.time_s, self.wheel_rad_s) = (time_s, after.clone());
        Frame {
            instant,
            wxyz: self.spline.sample(time_s).base_orientation_wxyz,
            wheel_rad,
            wheel_rad_s: after,
            torque_nm: self.whole.setpoints(time_s).1,
        }
    }
}

/// State at a time, with the speed of each end effector's wheel relative to its link, rad/s; 0 without a wheel that spins.
fn speeds(whole: &mut WholeBody, time_s: f64) -> (Instant, Vec<f64>) {
    let instant = whole.at(time_s, &Isometry3::identity());
    let tree = whole.tree();
    let speed = |foot| tree.wheel_dof(foot).map_or(0.0, |dof| instant.state.velocity[dof]);
    let speeds = (0..tree.robot().end_effectors.len()).map(speed).collect();
    (instant, speeds)
}
