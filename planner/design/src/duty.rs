//! Duty of the motors in the motions of a design, and the servos that suffice.

use crate::catalog::{Catalog, Servo};
use crate::plans::Plans;
use rollwalk_planner::plan::Plan;
use rollwalk_planner::sample::{PlanSpline, driven_wheels};
use rollwalk_planner::torque::InverseDynamics;
use rollwalk_robot::Actuator;

/// Sampling rate of the duty, Hz: the frame rate of motion libraries.
const RATE_HZ: f64 = 60.0;

/// Required speeds and torques of all motors of one model, either in joints or in wheels.
#[derive(Clone, Debug, PartialEq)]
pub struct Duty {
    /// Model of the actuator in the robot file.
    pub model: String,
    /// True if the motors drive wheels.
    pub wheels: bool,
    /// Names of the driven joints or wheels.
    pub motors: Vec<String>,
    /// Largest speed in any motion, rad/s.
    pub speed_rad_s: f64,
    /// Largest torque in any motion, N·m.
    pub torque_nm: f64,
    /// Simultaneous absolute speeds and torques, `[rad/s, N·m]`.
    points: Vec<[f64; 2]>,
}

impl Duty {
    /// Returns true if the speed limit, the torque limit and the torque-speed line of a servo suffice.
    pub fn can(&self, servo: &Servo) -> bool {
        let on_line = |[speed, torque]: &[f64; 2]| {
            let stall = servo.stall_torque_nm.map_or(0.0, |stall| torque / stall);
            stall + speed / servo.no_load_speed_rad_s <= 1.0
        };
        let speed_max_rad_s =
            if self.wheels { servo.wheel_speed_max_rad_s() } else { servo.speed_max_rad_s };
        self.speed_rad_s <= speed_max_rad_s
            && self.torque_nm <= servo.torque_max_nm
            && self.points.iter().all(on_line)
    }

    /// Servos of a catalogue that suffice, lightest first.
    pub fn servos<'c>(&self, catalog: &'c Catalog) -> Vec<&'c Servo> {
        let mut servos: Vec<&Servo> =
            catalog.servos().iter().filter(|servo| self.can(servo)).collect();
        servos.sort_by(|a, b| a.mass_kg.total_cmp(&b.mass_kg));
        servos
    }
}

/// Computes the duties of the motors in all motions of a design, by model.
pub fn duties(plans: &Plans) -> Vec<Duty> {
    let mut duties: Vec<Duty> = Vec::new();
    for plan in plans.plans() {
        let robot = &plan.robot;
        let driven: Vec<_> = robot.driven_joints().map(|joint| &robot.joints[joint]).collect();
        let joints = driven.iter().map(|joint| (&joint.name, &joint.actuator));
        let wheels =
            robot.end_effectors.iter().filter_map(|of| Some((&of.name, of.contact.actuator()?)));
        let motors: Vec<(&String, &Actuator)> = joints.chain(wheels).collect();
        for (index, points) in points(plan).into_iter().enumerate() {
            let (name, actuator) = motors[index];
            let (model, wheels) = (&actuator.model, index >= driven.len());
            let at = duties.iter().position(|duty| duty.model == *model && duty.wheels == wheels);
            let at = at.unwrap_or_else(|| {
                duties.push(Duty {
                    model: model.clone(),
                    wheels,
                    motors: Vec::new(),
                    speed_rad_s: 0.0,
                    torque_nm: 0.0,
                    points: Vec::new(),
                });
                duties.len() - 1
            });
            let duty = &mut duties[at];
            if !duty.motors.contains(name) {
                duty.motors.push(name.clone());
            }
            let largest =
                |of: usize, least: f64| points.iter().map(|p| p[of]).fold(least, f64::max);
            duty.speed_rad_s = largest(0, duty.speed_rad_s);
            duty.torque_nm = largest(1, duty.torque_nm);
            duty.points.extend(points);
        }
    }
    duties
}

/// Samples absolute speed and torque of each motor: joints first, then driven wheels. Wheel speeds and all torques are clamped
/// to their limits, as in a motion library.
fn points(plan: &Plan) -> Vec<Vec<[f64; 2]>> {
    let (spline, mut inverse) = (PlanSpline::new(plan), InverseDynamics::new(plan));
    let robot = &plan.robot;
    let wheel = |index: usize| robot.end_effectors[index].contact.actuator();
    let driven = robot.driven_joints().map(|joint| &robot.joints[joint].actuator);
    let joints = driven.map(|motor| (motor, f64::INFINITY));
    let wheels = driven_wheels(robot).filter_map(wheel).map(|of| (of, of.speed_max_rad_s));
    let motors: Vec<(&Actuator, f64)> = joints.chain(wheels).collect();
    let frames = (plan.motion.duration_s * RATE_HZ).round() as usize;
    let mut points = vec![Vec::with_capacity(frames); motors.len()];
    for frame in 0..frames {
        let time_s = frame as f64 / RATE_HZ;
        let (speeds, torques) = (spline.setpoints(time_s), inverse.at(time_s));
        let both = speeds.speeds_rad_s(robot).zip(torques.channels_nm(robot));
        for ((points, (motor, most_rad_s)), (speed, torque)) in
            points.iter_mut().zip(&motors).zip(both)
        {
            points.push([speed.abs().min(*most_rad_s), torque.abs().min(motor.torque_max_nm)]);
        }
    }
    points
}
