//! Derivatives of a plan's quantities with respect to the robot's parameters, as slopes per step of a parameter.

use serde::Serialize;

/// Quantity of a plan at its optimum, with its slopes.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct QuantitySlopes {
    /// Name, as in design files.
    pub name: &'static str,
    /// Unit; empty for none.
    pub unit: &'static str,
    pub value: f64,
    /// Value below which relative changes are not meaningful.
    pub little: f64,
    /// Slopes with respect to each differentiable parameter of the robot.
    pub slopes: Vec<Slope>,
}

/// First-order change of a quantity per step of a parameter.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Slope {
    /// Name of the parameter.
    pub name: String,
    /// Small change of the parameter, in its unit: a centimetre, or a tenth of a limit.
    pub step: f64,
    /// Change of the quantity for one step, after replanning the motion.
    pub by_step: f64,
}
