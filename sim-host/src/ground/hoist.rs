//! The hoist that carries a robot without torque, and when it lets go.

use crate::clock::SimTime;
use crate::servo::Servo;
use nalgebra::{Matrix3, Rotation3, Vector3};

/// Fastest that it goes up and down, m/s.
const SPEED_M_S: f64 = 0.3;
/// Time for which motors that stand have kept their targets, s.
const STILL_S: f64 = 0.1;
/// Time with torque after which a robot stands on its own whatever its motors do, s.
const LONGEST_S: f64 = 3.0;
/// Change of a joint's target that is none, rad.
const SAME_RAD: f64 = 1e-4;

/// Position at which the hoist holds the body's origin, m, and heading about the vertical, rad.
#[derive(Clone, Copy, Debug)]
pub struct Hoist {
    origin: Vector3<f64>,
    heading_rad: f64,
}

impl Hoist {
    /// A hoist with the body at a place, level.
    pub fn at(origin: Vector3<f64>, heading_rad: f64) -> Self {
        Self { origin, heading_rad }
    }

    /// Origin of the body, m, and world from body.
    pub fn pose(&self) -> (Vector3<f64>, Matrix3<f64>) {
        (self.origin, *Rotation3::from_axis_angle(&Vector3::z_axis(), self.heading_rad).matrix())
    }

    /// Moves so that what is lowest of the robot, at this height above the ground, m, just touches it.
    pub fn follow_feet(&mut self, clearance_m: f64, step_s: f64) {
        let most_m = SPEED_M_S * step_s;
        self.origin.z -= clearance_m.clamp(-most_m, most_m);
    }
}

/// Condition for the hoist to let go.
#[derive(Clone, Debug)]
pub enum LetsGo {
    /// Robot begins to play.
    WhenItPlays,
    /// Motors all have torque and stand still, or have had torque for some seconds.
    WhenItStands(StillWatch),
}

/// Sees when all motors have torque and keep their targets.
#[derive(Clone, Debug, Default)]
pub struct StillWatch {
    targets_rad: Vec<f64>,
    still_since: SimTime,
    torque_since: SimTime,
}

impl StillWatch {
    /// True if the motors stand. Must be called in each step.
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
