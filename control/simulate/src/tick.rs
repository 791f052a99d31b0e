//! Tick of a controller in closed loop: measurements, timing, setpoints, and why there are none.

use rollwalk_multibody::State;
use rollwalk_physics::motor::Law;
use rollwalk_tracking::estimator::Untrusted;
use rollwalk_tracking::{NoSetpoints, Sensors, Setpoint};
use thiserror::Error;

/// Time without setpoints of the tracker after which the motion is ended, s.
pub(crate) const LOST_S: f64 = 0.1;

/// Knowledge of the robot at a tick.
#[derive(Clone, Copy, Debug)]
pub enum Measured<'a> {
    /// State in the world of the plan's placement, and whether each end effector touches the ground.
    State(&'a State, &'a [bool]),
    /// Measurements of the sensors since the last tick.
    Sensors(&'a Sensors<'a>),
}

/// Reason for which the motors got the plan as in open loop, or its stop.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Error)]
pub enum Untracked {
    /// The state is not known well enough.
    #[error("{0}")]
    State(Untrusted),
    /// The tracker found no setpoints.
    #[error("{0}")]
    Setpoints(NoSetpoints),
    /// Pushed beyond the edge of its support: the steps of its plan go on under it.
    #[error(
        "it was pushed beyond the edge of its support, and the steps of its plan are to catch it"
    )]
    CaughtBySteps,
    /// Recovered twice right after resuming the plan, which goes on in open loop until it ends.
    #[error("it stumbled from one recovery into the next, and its plan goes on in open loop")]
    Stumbled,
    /// Untracked for 0.1 s: the robot comes to rest, and stays so.
    #[error(
        "it was not tracked for {LOST_S} s, and is brought to a stop for good: begin the motion anew"
    )]
    Stopped,
}

/// Timing of a controller.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Timing {
    /// Interval between ticks, s.
    pub tick_s: f64,
    /// Time from a measurement until the motors act on the setpoints computed from it, s, beyond the tick itself.
    pub latency_s: f64,
}

/// A servo with what it is to do until the next tick.
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
