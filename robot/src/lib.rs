//! The robot description: kinematic tree, masses, limits, actuators and end effectors.
//!
//! First station of the data flow: `robots/*.toml` becomes a validated [`Robot`], which the planner,
//! the simulated robot and (as [`rollwalk_protocol::config::RobotConfig`]) the firmware share.
//! Frames, units and orders: `docs/conventions.md`.

mod controller;
pub mod document;
mod file;
mod model;
mod pose;
mod rules;
pub mod urdf;

pub use controller::{Blade, Channel};
pub use model::{Actuator, Contact, EndEffector, Joint, Link, Robot, RollingDrag, TorqueSpeedLine};
pub use rules::{InvalidRobot, Place, Violation};
