//! Controls: knots of curves for targets of motors.

use crate::curve::Curve;
use crate::sensitivity::parameter::targets::target_by;
use crate::sensitivity::parameter::{Column, Parameter, SolvedStep};
use std::sync::Arc;

/// Knot of a curve that is added to a motor's target at the end of each step: angle and speed,
/// [`Law::position_rad`](crate::motor::Law) and `speed_rad_s`.
#[derive(Clone, Debug)]
pub struct Control {
    /// Force index of the motor.
    pub motor: usize,
    /// Curve of the target.
    pub curve: Arc<Curve>,
    /// Index of the knot.
    pub knot: usize,
    /// True if the speed of the curve is added too. Some servos take no speed.
    pub takes_speed: bool,
}

impl Control {
    /// Creates parameters for the knots of several motors' curves: the first knot of each motor, then the second. In this
    /// order, later targets cost nothing. Flags of `takes_speed` are set for the motors whose targets have a speed.
    pub fn of_all(
        motors: &[usize],
        takes_speed: &[bool],
        curve: &Arc<Curve>,
    ) -> Vec<Box<dyn Parameter>> {
        let of_knot = |knot: usize| {
            let targets = motors.iter().zip(takes_speed);
            targets.map(move |(&motor, &takes_speed)| -> Box<dyn Parameter> {
                Box::new(Self { motor, curve: Arc::clone(curve), knot, takes_speed })
            })
        };
        (0..curve.knots).flat_map(of_knot).collect()
    }
}

impl Parameter for Control {
    fn residual(&self, solved: &SolvedStep<'_>, column: &mut Column) {
        let [angle, speed] = self.curve.of_knot(self.knot, solved.time_s);
        let speed = if self.takes_speed { speed } else { 0.0 };
        target_by(solved, self.motor, [angle, speed, 0.0], column);
    }
}
