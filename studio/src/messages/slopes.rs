//! Slopes of a plan's quantities with respect to the robot's parameters.

use serde::Serialize;

/// A quantity of a plan at its optimum, with its slopes.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct SlopesOf {
    /// Name, as in design files.
    pub name: &'static str,
    /// Unit; empty for none.
    pub unit: &'static str,
    pub value: f64,
    /// Value below which changes are not compared with it.
    pub little: f64,
    /// Slopes with respect to each differentiable parameter of the robot.
    pub slopes: Vec<Slope>,
}

/// First-order change of a quantity with a parameter.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Slope {
    /// Name of the parameter.
    pub name: String,
    /// Small change of the parameter, in its unit: a centimetre, a tenth of a limit.
    pub step: f64,
    /// Change of the quantity for this step, after replanning the motion.
    pub by_step: f64,
}
