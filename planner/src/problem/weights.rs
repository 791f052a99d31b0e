//! Penalties, weights and margins of the formulation.

/// Penalties, weights and margins. The defaults gave the best results in measurements; each field states its effect
/// on the result. Weights of costs are per sample at a spacing of 0.05 s and are converted to the actual spacing
/// (`Problem::per_time`), so that more samples refine a plan without changing the balance of its costs.
#[derive(Clone, Debug, PartialEq)]
pub struct Weights {
    /// Penalty of every constraint. Multipliers make constraints exact; the penalty determines how hard the first
    /// steps pull towards them. A larger penalty is more reliable for walking, slower for rolling.
    pub penalty: f64,
    /// Smoothness of q (thesis: 0.1): second differences, rad and m.
    pub smoothness: f64,
    /// Pull of the ground forces of feet and driven wheels towards an even share of the weight. It determines whether
    /// a plan can be played with soft servos. Too low, and the plan relies on internal forces that no servo
    /// reproduces; too high, and walking plans, whose steps must shift the weight, can be played less well.
    pub force: f64,
    /// The same for free wheels, which turn lateral forces into thrust. Too low, and they swizzle with small strokes
    /// and large forces, which soft servos cannot transmit.
    pub free_wheel_force: f64,
    /// Pull of joints and body towards the motion's posture. Too low, and the body drifts and feet gather below it;
    /// too high, and feet scrub over the ground.
    pub posture: f64,
    /// Pull of wheel speeds (rim speed, m/s) towards zero, which determines them in swing.
    pub wheel_speed: f64,
    /// Pull of wheel speeds towards a constant (differences of rim speed, m/s), because wheels have inertia. Too low,
    /// and transitions require 50 rad/s² of the wheels; too high, and legs lean where wheels should roll.
    pub wheel_smoothness: f64,
    /// Pull of feet and driven wheels to stand still (m/s) in the interval at lift-off and touch-down in which force
    /// and foot leave the ground together. Too low, and the force is missing; too high, and swings are too fast.
    pub lift_off_slip: f64,
    /// Pull of the body's velocity towards the wanted one where a motion is steered (m/s and rad/s). Too low, and the robot
    /// follows late, and too slowly where its legs have to leave their posture for it; too high, and after pushes it follows
    /// with its feet at the limits of friction, so that plans are rejected (`docs/receding-horizon.md`).
    pub steering: f64,
    /// Smallest normal force of a foot in stance, as a fraction of its even share of the weight.
    pub least_normal_force: f64,
    /// Fraction of the friction cone available to plans; the rest is a reserve for disturbances.
    pub friction_use: f64,
}

impl Default for Weights {
    fn default() -> Self {
        Self {
            penalty: 1000.0,
            smoothness: 0.1,
            force: 3e-4,
            free_wheel_force: 3e-2,
            posture: 4e-3,
            wheel_speed: 1e-6,
            wheel_smoothness: 0.1,
            lift_off_slip: 1.0,
            steering: 0.1,
            least_normal_force: 0.1,
            friction_use: 0.8,
        }
    }
}

/// Sample spacing at which the weight of a cost is the factor of its squares, s.
pub(super) const WEIGHT_INTERVAL_S: f64 = 0.05;
