//! Implicit simulation of robots on the ground, with exact derivatives (thesis ch. 4).
//!
//! A [`System`] is bodies and [`Force`]s. One step of it, backward Euler or BDF2, is a root of the force residual that
//! Newton's method finds; joints, motors and contacts are forces, stiff ones, and each brings its own derivatives.
//! World axes, SI units.
//!
//! | module | is |
//! |---|---|
//! | [`motion`], [`rotation`] | pose and velocity, and how they follow from what a step moves; rotation increments |
//! | [`body`], [`assembly`] | what moves: rigid bodies and particles; bodies and forces before they are a system |
//! | [`force`] | the interface of what acts on bodies |
//! | [`points`], [`joint`], [`spring`], [`anchor`], [`motor`] | what holds points together; joints as stiff springs; springs and strings; bolts in the world; motors |
//! | [`soft`] | soft bodies of tetrahedra |
//! | [`hold`], [`push`] | a hoist, a stand or a hand; forces from outside |
//! | [`collision`] | contact of a point of one body with another body |
//! | [`contact`], [`friction`], [`touch`], [`event`] | contact with the ground, its friction law, its reported state, and touch-down, lift-off and slip |
//! | [`system`] | the step, halved where it does not converge |
//! | [`sensitivity`] | derivatives of whole rollouts by what they depend on, direct and adjoint |
//! | [`curve`] | curves of time through knots, which motors' targets follow |
//! | `newton`, `kinks`, `residual`, `matrix`, `block_lu`, `sticking` | how a step is solved: the method, how it passes where forces are not smooth, the equations, their matrix and its factors, what friction holds |
//! | [`world`] | a robot from its description |
//!
//! ```
//! use rollwalk_multibody::ground::{Ground, Plane};
//! use rollwalk_physics::World;
//! use rollwalk_physics::world::Parameters;
//! use std::sync::Arc;
//!
//! let text = std::fs::read_to_string("../shipped/robots/test_leg.toml")?;
//! let robot = rollwalk_robot::Robot::from_toml("test_leg.toml", &text)?;
//! let ground: Arc<dyn Ground> = Arc::new(Plane::level());
//! let mut world = World::standing(&robot, &ground, &Parameters::new(&robot));
//! for _ in 0..10 {
//!     world.step(0.002)?;
//! }
//! assert!((world.system().time_s() - 0.02).abs() < 1e-12);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

#![warn(missing_docs)]

pub mod anchor;
pub mod assembly;
mod block_lu;
pub mod body;
#[cfg(test)]
mod check;
pub mod collision;
pub mod contact;
pub mod curve;
pub mod event;
pub mod force;
pub mod friction;
pub mod hold;
pub mod joint;
mod kinks;
mod matrix;
pub mod motion;
pub mod motor;
mod newton;
pub mod points;
pub mod push;
mod report;
mod residual;
pub mod rotation;
pub mod sensitivity;
pub mod soft;
pub mod spring;
mod sticking;
pub mod system;
pub mod touch;
pub mod world;

pub use assembly::Assembly;
pub use body::{Body, Inertia};
pub use event::{ContactChange, ContactEvent};
pub use force::Force;
pub use motion::{Motion, Scheme};
pub use system::{Energy, Settings, StepError, StepReport, System};
pub use touch::Touch;
pub use world::World;
