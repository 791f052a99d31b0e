//! Tick of a closed-loop controller: measurements, timing, set-points, and reasons for missing set-points.

use rollwalk_multibody::State;
use rollwalk_physics::motor::Law;
use rollwalk_tracking::estimator::EstimateError;
use rollwalk_tracking::{NoSetpoints, Sensors, Setpoint};
use thiserror::Error;

/// Time without set-points of the tracker after which the motion is stopped, s.
pub(crate) const LOST_S: f64 = 0.1;

/// Measurement at a tick.
#[derive(Clone, Copy, Debug)]
pub enum Measurement<'a> {
    /// State of the robot in the world, and contact flag of each end effector.
    State(&'a State, &'a [bool]),
    /// Measurements of the sensors since the previous tick.
    Sensors(&'a Sensors<'a>),
}

/// Reason why the motors get the set-points of the plan or of its stop instead of tracked ones.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Error)]
pub enum TrackingError {
    /// State estimate that cannot be trusted.
    #[error("{0}")]
    State(EstimateError),
    /// Tracker without a solution.
    #[error("{0}")]
    Setpoints(NoSetpoints),
    /// Push beyond the edge of the support. The steps of the plan continue to catch the robot.
    #[error(
        "the robot was pushed beyond the edge of its support; the plan continues, so that its \
         steps catch the robot"
    )]
    CaughtBySteps,
    /// Second recovery right after resuming the plan, which continues in open loop until it ends.
    #[error("a second recovery followed directly on the first; the plan continues in open loop")]
    Stumbled,
    /// Stop after 0.1 s without tracking. The robot comes to rest and does not resume.
    #[error(
        "the tracking controller had no setpoints for {LOST_S} s, and stops the robot; start the motion again"
    )]
    Stopped,
}

/// Timing of a controller.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Timing {
    /// Interval between ticks, s.
    pub tick_s: f64,
    /// Time from a measurement until its set-points act, s, in addition to the tick itself.
    pub latency_s: f64,
}

/// Control law of a servo with a set-point until the next tick.
pub(crate) fn law(servo: &Law, setpoint: &Setpoint) -> Law {
    Law {
        kp_nm_rad: setpoint.kp_nm_rad,
        kd_nm_s_rad: setpoint.kd_nm_s_rad,
        position_rad: setpoint.position_rad,
        speed_rad_s: setpoint.speed_rad_s,
        torque_nm: setpoint.torque_nm,
        ..*servo
    }
}
