//! Targets of motors that change with a parameter in a way of their own: a delay, a scale, an encoder that is off.

use crate::force::Wrench;
use crate::motor::Motor;
use crate::sensitivity::parameter::{Column, Parameter, Solved};
use std::fmt;
use std::sync::Arc;

/// Change of motors' targets with a parameter.
#[derive(Clone)]
pub struct Targets {
    /// Forces that are the motors.
    pub motors: Vec<usize>,
    /// Derivatives of angle, speed and feed-forward torque that a motor, by its place among `motors`, is to have at the end of
    /// a step, by the parameter. Of a delay they are minus the slopes of these, of an offset of the encoder −1, 0 and 0.
    #[allow(clippy::type_complexity, reason = "it is named nowhere else")]
    pub by: Arc<dyn Fn(usize, f64) -> [f64; 3] + Send + Sync>,
}

impl fmt::Debug for Targets {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Targets").field("motors", &self.motors).finish_non_exhaustive()
    }
}

impl Parameter for Targets {
    fn residual(&self, solved: &Solved<'_>, column: &mut Column) {
        for (place, &motor) in self.motors.iter().enumerate() {
            target_by(solved, motor, (self.by)(place, solved.time_s), column);
        }
    }
}

/// Adds what changes of the target of a motor, angle, speed and torque, do.
pub(super) fn target_by(
    solved: &Solved<'_>,
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
        let moment = motor.axis_in_world(&view.now[0]) * change;
        [-moment, moment].map(|moment| Wrench { moment, ..Wrench::default() })
    });
    column.add_force(&motor.bodies, &wrenches);
}
