//! Implicit simulation of robots on the ground, with exact derivatives (thesis ch. 4).
//!
//! A [`System`] consists of bodies and [`Force`]s. Each step, backward Euler or BDF2, solves the force balance by Newton's
//! method. Joints, motors and contacts are stiff forces, and each supplies its own derivatives. World axes, SI units.
//!
//! | module | content |
//! |---|---|
//! | [`motion`], [`rotation`] | pose and velocity, and their update in a step; rotation increments |
//! | [`body`], [`assembly`] | rigid bodies and particles; bodies and forces from which a system is built |
//! | [`force`] | interface of forces on bodies |
//! | [`points`], [`joint`], [`spring`] | forces between two points; joints as stiff springs; springs and strings |
//! | [`anchor`], [`motor`], [`coupled_motor`] | springs to the world; motors of one and of several hinges |
//! | [`soft`] | soft bodies of tetrahedra |
//! | [`hold`], [`push`] | hoist, stand or hand; external forces |
//! | [`collision`] | contact of a point of one body with another body |
//! | [`contact`], [`friction`], [`touch`] | contact with the ground, its friction law and its reported state |
//! | [`event`] | touch-down, lift-off and slip |
//! | [`system`] | stepping, with steps halved if they do not converge |
//! | [`sensitivity`] | direct and adjoint derivatives of whole rollouts |
//! | [`curve`] | curves of time through knots, for targets of motors |
//! | `newton`, `kinks`, `residual` | Newton's method, kinks of forces, and equations of a step |
//! | `matrix`, `block_lu`, `sticking` | Newton matrix, its factors, and hybrid friction |
//! | [`world`] | robot built from its description |
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
pub mod coupled_motor;
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
pub mod slide;
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
pub use motion::{BodyMotion, Scheme};
pub use system::{Energy, Settings, StepError, StepReport, System};
pub use touch::Touch;
pub use world::World;
