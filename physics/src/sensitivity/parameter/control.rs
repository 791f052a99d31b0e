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
}

impl Control {
    /// Creates parameters for the knots of several motors' curves: the first knot of each motor, then the second. In this
    /// order, later targets cost nothing.
    pub fn of_all(motors: &[usize], curve: &Arc<Curve>) -> Vec<Box<dyn Parameter>> {
        let of_knot = |knot: usize| {
            motors.iter().map(move |&motor| -> Box<dyn Parameter> {
                Box::new(Self { motor, curve: Arc::clone(curve), knot })
            })
        };
        (0..curve.knots).flat_map(of_knot).collect()
    }
}

impl Parameter for Control {
    fn residual(&self, solved: &SolvedStep<'_>, column: &mut Column) {
        let [angle, speed] = self.curve.of_knot(self.knot, solved.time_s);
        target_by(solved, self.motor, [angle, speed, 0.0], column);
    }
}
