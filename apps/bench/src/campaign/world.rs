//! Behaviour of the robot itself in a run on the ground: falls, tilt, and distance without torque.

use nalgebra::Vector3;
use rollwalk_sim_host::body::Body;
use rollwalk_sim_host::clock::SimTime;
use rollwalk_sim_host::ground::{Fall, Grounded};
use rollwalk_sim_host::rig::Observer;
use rollwalk_sim_host::servo::Servo;

/// Steepest slope of a run, degrees, up or down in the direction of travel.
pub const SLOPE_MAX_DEG: f64 = 3.0;
/// Speed of the centre of mass below which a robot without torque rests, m/s.
const REST_M_S: f64 = 0.05;

/// Report of a run on the ground.
#[derive(Clone, Debug, Default)]
pub struct WorldReport {
    /// Slope of the ground, rad; positive if the ground rises ahead of the robot at the start.
    pub slope_rad: f64,
    pub falls: Vec<Fall>,
    /// Largest angle between the body's z axis and the vertical while the hoist does not hold the robot, rad.
    pub tilt_max_rad: f64,
    /// Largest horizontal distance from the position at which torque was lost, m, until the robot was lifted or armed again.
    pub coasted_m: f64,
    /// Longest time without torque after which the robot still moved, s. For a robot that never rests, the time until it is
    /// lifted.
    pub rested_after_s: f64,
}

/// Observer of the robot after every step of the motors.
#[derive(Debug, Default)]
pub struct WorldWatch {
    report: WorldReport,
    /// Position of the robot and time at the loss of torque; `None` while motors have torque or the hoist holds the robot.
    limp: Option<(Vector3<f64>, SimTime)>,
}

impl WorldWatch {
    /// Creates the observer of a robot on a slope, rad.
    pub fn new(slope_rad: f64) -> Self {
        let report = WorldReport { slope_rad, ..WorldReport::default() };
        Self { report, limp: None }
    }

    /// Report on the run so far.
    pub fn report(&self) -> &WorldReport {
        &self.report
    }

    fn record(&mut self, at: SimTime, ground: &Grounded, is_driving: bool) {
        let report = &mut self.report;
        report.falls = ground.falls().to_vec();
        if ground.is_held() {
            self.limp = None;
            return;
        }
        let tilt_rad = ground.up_in_body().z.clamp(-1.0, 1.0).acos();
        report.tilt_max_rad = report.tilt_max_rad.max(tilt_rad);
        if is_driving {
            self.limp = None;
            return;
        }
        let (com, velocity) = ground.world().com();
        let (start, since) = *self.limp.get_or_insert((com, at));
        report.coasted_m = report.coasted_m.max((com - start).xy().norm());
        if velocity.norm() > REST_M_S {
            report.rested_after_s = report.rested_after_s.max((at - since).as_s());
        }
    }
}

impl Observer for WorldWatch {
    fn on_motor_step(&mut self, at: SimTime, body: &Body) {
        if let Some(ground) = body.ground() {
            self.record(at, ground, body.servos().iter().any(Servo::is_driving));
        }
    }
}
