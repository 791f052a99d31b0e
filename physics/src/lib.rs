//! Implicit simulation of robots on the ground, with exact derivatives (thesis ch. 4).
//!
//! A [`System`] is bodies and [`Force`]s. One step of it, backward Euler or BDF2, is a root of the force residual that
//! Newton's method finds; joints, motors and contacts are forces, stiff ones, and each brings its own derivatives.
//! World axes, SI units.
//!
//! | module | is |
//! |---|---|
//! | [`motion`] | pose and velocity, and how they follow from what a step moves |
//! | [`rotation`] | rotation increments |
//! | [`force`] | the interface of what acts on bodies |
//! | [`joint`], [`motor`] | hinges as stiff springs; motors on them |
//! | [`ground`], [`contact`], [`friction`] | what is solid; what touches it; how it slides |
//! | [`system`] | the step |
//! | [`world`] | a robot from its description |

#[cfg(test)]
mod check;
pub mod contact;
pub mod force;
pub mod friction;
pub mod ground;
pub mod joint;
mod matrix;
pub mod motion;
pub mod motor;
pub mod rotation;
pub mod system;
pub mod world;

pub use force::Force;
pub use motion::{Motion, Scheme};
pub use system::{Inertia, Settings, StepError, StepReport, System};
pub use world::World;
