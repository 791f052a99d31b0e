//! Hoist that carries a robot without torque, and the conditions for releasing the robot.

use crate::clock::SimTime;
use crate::servo::Servo;
use nalgebra::{Matrix3, Rotation3, Vector3};

/// Maximum vertical speed of the hoist, m/s.
const SPEED_M_S: f64 = 0.3;
/// Vertical speed at which the hoist lifts feet that press on the ground, m/s.
const LIFT_M_S: f64 = 0.1;
/// Smallest depth in the ground at which feet count as pressing, m.
const PRESSED_M: f64 = 1e-5;
/// Time with unchanged targets after which motors count as standing, s.
const STILL_S: f64 = 0.1;
/// Time with torque after which motors count as standing even if their targets change, s.
const LONGEST_S: f64 = 3.0;
/// Largest change of a joint's target that counts as no change, rad.
const SAME_RAD: f64 = 1e-4;

/// Hoist, which holds the origin of the body at a point, m, with a heading about the vertical, rad.
#[derive(Clone, Copy, Debug)]
pub struct Hoist {
    origin: Vector3<f64>,
    heading_rad: f64,
    is_loaded: bool,
}

impl Hoist {
    /// Creates a hoist that holds the body level, with its origin at a point.
    pub fn at(origin: Vector3<f64>, heading_rad: f64) -> Self {
        Self { origin, heading_rad, is_loaded: false }
    }

    /// Origin of the body, m, and rotation from body to world.
    pub fn pose(&self) -> (Vector3<f64>, Matrix3<f64>) {
        (self.origin, *Rotation3::from_axis_angle(&Vector3::z_axis(), self.heading_rad).matrix())
    }

    /// Moves vertically until the lowest point of the robot touches the ground; `clearance_m` is its present height, m.
    ///
    /// Legs with torque that press on the ground hardly sink into it, so the hoist follows them slowly. If `lifts`, the hoist
    /// rises at a speed of its own until no foot presses.
    pub fn follow_feet(&mut self, clearance_m: f64, step_s: f64, lifts: bool) {
        let most_m = SPEED_M_S * step_s;
        self.is_loaded = clearance_m < -PRESSED_M;
        let lift_m = if lifts && self.is_loaded { LIFT_M_S * step_s } else { 0.0 };
        self.origin.z += (lift_m - clearance_m).clamp(-most_m, most_m);
    }

    /// True if feet press on the ground. The hoist is then too low for the pose of the legs.
    pub fn is_loaded(&self) -> bool {
        self.is_loaded
    }
}

/// Condition for releasing the robot.
#[derive(Clone, Debug)]
pub enum ReleaseCondition {
    /// The robot begins to play.
    WhenItPlays,
    /// The motors all have torque and stand still, or have had torque for some seconds.
    WhenItStands(StillWatch),
}

/// Detects that all motors have torque and keep their targets.
#[derive(Clone, Debug, Default)]
pub struct StillWatch {
    targets_rad: Vec<f64>,
    still_since: SimTime,
    torque_since: SimTime,
}

impl StillWatch {
    /// True if the motors stand. Call it in each step.
    pub fn stands(&mut self, now: SimTime, servos: &[Servo]) -> bool {
        let targets: Vec<f64> = servos.iter().map(|servo| servo.law().position_rad).collect();
        let same = targets.len() == self.targets_rad.len()
            && targets.iter().zip(&self.targets_rad).all(|(a, b)| (a - b).abs() < SAME_RAD);
        let has_torque = servos.iter().all(Servo::is_driving);
        self.targets_rad = targets;
        if !has_torque {
            self.torque_since = now;
        }
        if !has_torque || !same {
            self.still_since = now;
        }
        (now - self.still_since).as_s() > STILL_S || (now - self.torque_since).as_s() > LONGEST_S
    }
}
