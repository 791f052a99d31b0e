//! Penalties, weights and margins of the formulation.

use crate::families::CLEARANCE_M;

/// Penalties, weights and margins. The defaults are the ones that measured best; each field says what
/// it does to the result. Weights of costs are per sample at a spacing of 0.05 s and follow the spacing
/// (`Problem::per_time`), so that more samples refine a plan and do not make another of it.
#[derive(Clone, Debug, PartialEq)]
pub struct Weights {
    /// Penalty of every constraint. Multipliers make constraints exact; the penalty sets how hard the
    /// first steps pull towards them. Larger is surer for walking, slower for rolling.
    pub penalty: f64,
    /// Smoothness of q (thesis: 0.1): second differences, rad and m.
    pub smoothness: f64,
    /// Pull of the ground forces of feet and driven wheels towards an even share of the weight. Decides
    /// whether a plan survives soft servos: too low and it leans on internal forces that no servo
    /// reproduces; too high and the steps of a walk, which must shift the weight, transfer worse.
    pub force: f64,
    /// The same for free wheels, which turn lateral forces into thrust: too low and they swizzle with
    /// small strokes and large forces, which soft servos swallow.
    pub free_wheel_force: f64,
    /// Pull of joints and body towards the motion's posture. Too low and the body drifts and feet gather
    /// below it; too high and gaits scrub their feet.
    pub posture: f64,
    /// Pull of wheel speeds towards zero (rim speed, m/s), which fixes them in swing.
    pub wheel_speed: f64,
    /// Pull of wheel speeds towards a constant (rim speed differences, m/s): wheels have inertia. Too
    /// low and transitions ask 50 rad/s² of the wheels; too high and legs lean instead of wheels rolling.
    pub wheel_smoothness: f64,
    /// Least normal force of a foot in stance, as a fraction of its even share of the weight.
    pub least_normal_force: f64,
    /// Part of the friction cone that plans use; the rest is for disturbances.
    pub friction_use: f64,
    /// Clearance β between end effectors, m (Eq. 2.10).
    pub clearance_m: f64,
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
            least_normal_force: 0.1,
            friction_use: 0.8,
            clearance_m: CLEARANCE_M,
        }
    }
}

/// Sample spacing at which a cost's weight is the factor before its squares, s.
pub(super) const WEIGHT_INTERVAL_S: f64 = 0.05;
