//! Penalties, weights and margins of the formulation.

/// Penalties, weights and margins. The defaults gave the best results in measurements, and each field describes its effect on the
/// plan. Weights of costs over the whole motion are per sample at a spacing of 0.05 s. `Problem::per_time` converts them to the
/// actual spacing, so that more samples refine a plan without changing the balance of its costs. `end_lean` and `lift_off_slip`
/// are per event instead.
#[derive(Clone, Debug, PartialEq)]
pub struct Weights {
    /// Penalty of every constraint. Multipliers make constraints exact; the penalty determines the pull of the first steps
    /// towards them. A larger penalty is more reliable for walking and slower for rolling.
    pub penalty: f64,
    /// Weight of the smoothness of q (thesis: 0.1): second differences, rad and m.
    pub smoothness: f64,
    /// Pull of the ground forces of feet and driven wheels towards an even share of the weight. If too low, the plan relies on
    /// internal forces that soft servos cannot reproduce. If too high, walking plans, whose steps must shift the weight,
    /// transfer less well.
    pub force: f64,
    /// Pull of the ground forces of free wheels, which turn lateral forces into thrust, towards an even share of the weight. If
    /// too low, they swizzle with small strokes and large forces, which soft servos cannot transmit.
    pub free_wheel_force: f64,
    /// Pull of joints and body towards the motion's posture. If too low, the body drifts and feet gather below it. If too high,
    /// feet scrub over the ground.
    pub posture: f64,
    /// Pull of the final body pose over the end effectors towards the initial one, in motions at rest (m and rad). If too low,
    /// feet and wheels move by less than the goal.
    pub end_lean: f64,
    /// Pull of wheel speeds (rim speed, m/s) towards zero, which determines them in swing.
    pub wheel_speed: f64,
    /// Pull of wheel speeds towards a constant (differences of rim speed, m/s), because wheels have inertia. If too low,
    /// transitions require wheel accelerations of 50 rad/s². If too high, legs lean where wheels should roll.
    pub wheel_smoothness: f64,
    /// Pull of feet and driven wheels towards standstill (m/s) in the interval of lift-off or touch-down, in which the foot still
    /// carries force. If too low, this force is missing as played. If too high, swings are too fast.
    pub lift_off_slip: f64,
    /// Pull of the body's velocity towards the requested one in steered motions (m/s and rad/s). If too low, the robot follows
    /// late, and too slowly if its legs must leave their posture. If too high, feet reach the limits of friction after a push,
    /// and plans are rejected (`docs/receding-horizon.md`).
    pub steering: f64,
    /// Smallest normal force of a foot in stance, as a fraction of its even share of the weight.
    pub least_normal_force: f64,
    /// Fraction of the friction cone that plans may use. The rest is a reserve for disturbances.
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
            end_lean: 100.0,
            wheel_speed: 1e-6,
            wheel_smoothness: 0.1,
            lift_off_slip: 1.0,
            steering: 0.1,
            least_normal_force: 0.1,
            friction_use: 0.8,
        }
    }
}

/// Sample spacing at which `Problem::per_time` is 1, s.
pub(super) const WEIGHT_INTERVAL_S: f64 = 0.05;
