//! Robot description: kinematic tree, masses, limits, actuators and end effectors.
//!
//! This crate is the first stage of the data flow. It reads `robots/*.toml` into a validated [`Robot`], which planner and
//! simulator share. The firmware receives it as [`rollwalk_protocol::config::RobotConfig`]. Frames, units and orders:
//! `docs/conventions.md`.
//!
//! ```
//! let text = std::fs::read_to_string("../shipped/robots/pup.toml")?;
//! let robot = rollwalk_robot::Robot::from_toml("pup.toml", &text)?;
//! assert_eq!(robot.joints.len() + robot.end_effectors.len(), 12);
//!
//! // What is wrong is said with its place and what would be right.
//! let wrong = text.replacen("mass_kg = ", "mass_kg = -", 1);
//! let error = rollwalk_robot::Robot::from_toml("pup.toml", &wrong).unwrap_err();
//! assert!(error.to_string().contains("pup.toml"));
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

#![warn(missing_docs)]

mod actuator;
mod blade;
mod body_points;
pub mod catalog;
mod channel;
mod clearance;
mod contact;
mod controller;
mod data_sheets;
pub mod document;
mod file;
mod linkage;
mod model;
mod pose;
mod rules;
pub mod shape;
mod solid;
mod spring;
mod transmission;
pub mod urdf;

pub use actuator::{Actuator, TorqueSpeedLine};
pub use blade::Blade;
pub use channel::Channel;
pub use clearance::ClearancePair;
pub use contact::{Contact, RollingDrag};
pub use linkage::{CrankMap, CrankState};
pub use model::{EndEffector, Joint, JointRatio, Link, Linkage, Robot, SoftMaterial};
pub use pose::roll_pitch_yaw;
pub use rules::{InvalidRobot, Item, Violation};
pub use solid::{Form, Solid};
pub use spring::JointSpring;
pub use transmission::{Ratios, Transmission};

/// Standard gravity, m/s².
pub const GRAVITY_M_S2: f64 = 9.806_65;
