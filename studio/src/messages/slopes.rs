//! How the robot's parameters change what a plan is judged by.

use serde::Serialize;

/// A quantity of a plan at its optimum, with its slopes.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct SlopesOf {
    /// Its name, as design files spell it.
    pub name: &'static str,
    /// Its unit; empty for none.
    pub unit: &'static str,
    pub value: f64,
    /// Value below which changes are not compared with it.
    pub little: f64,
    /// Of each parameter of the robot that can be differentiated by.
    pub slopes: Vec<Slope>,
}

/// How a quantity changes with a parameter, to first order.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Slope {
    /// Name of the parameter.
    pub name: String,
    /// A small change of it, in its unit: a centimetre, a tenth of a limit.
    pub step: f64,
    /// Change of the quantity with that, the motion planned anew.
    pub by_step: f64,
}
