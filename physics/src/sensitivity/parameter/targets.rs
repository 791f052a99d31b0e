//! Targets of motors that depend on a parameter, such as a delay, a scale or an encoder offset.

use crate::motor::Motor;
use crate::sensitivity::parameter::{Column, Parameter, SolvedStep};
use std::fmt;
use std::sync::Arc;

/// Dependence of motors' targets on a parameter.
#[derive(Clone)]
pub struct Targets {
    /// Force indices of the motors.
    pub motors: Vec<usize>,
    /// Derivatives of target angle, speed and feed-forward torque with respect to the parameter. The arguments are the motor's
    /// index in `motors` and the time at the end of a step, s. For a delay, the derivatives are minus the rates of the targets;
    /// for an encoder offset, −1, 0 and 0.
    #[allow(clippy::type_complexity, reason = "the type has no other use")]
    pub by: Arc<dyn Fn(usize, f64) -> [f64; 3] + Send + Sync>,
}

impl fmt::Debug for Targets {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Targets").field("motors", &self.motors).finish_non_exhaustive()
    }
}

impl Parameter for Targets {
    fn residual(&self, solved: &SolvedStep<'_>, column: &mut Column) {
        for (place, &motor) in self.motors.iter().enumerate() {
            target_by(solved, motor, (self.by)(place, solved.time_s), column);
        }
    }
}

/// Adds the derivative for a change of a motor's target angle, speed and torque.
pub(super) fn target_by(
    solved: &SolvedStep<'_>,
    number: usize,
    [angle, speed, torque]: [f64; 3],
    column: &mut Column,
) {
    if [angle, speed, torque] == [0.0; 3] {
        return;
    }
    let motor: &Motor = solved.force(number);
    let wrenches = solved.view(number, |view| {
        let by = motor.law_by(view);
        let change = by.position_nm_rad * angle + by.speed_nm_s_rad * speed + by.torque * torque;
        motor.unit_wrenches(view.now).map(|unit| unit * change)
    });
    column.add_force(&motor.bodies, &wrenches);
}
