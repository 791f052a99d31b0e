//! Robots and plans in the formats of other tools, which read them without Rollwalk.
//!
//! | format | of | for |
//! |---|---|---|
//! | [`urdf`] | a robot | ROS, Pinocchio, viewers |
//! | [`urdf_with_control`], [`controllers`] | a robot | `ros2_control` of ROS 2 |
//! | [`mjcf`], [`motion`] | a robot; a plan as keyframes with controls | MuJoCo |
//! | [`trajectory`] | a plan | ROS, by way of JSON |
//! | [`motion_data`] | a plan as arrays of NumPy | learning: mjlab, Isaac Lab |
//! | [`foxglove`] | a plan as an MCAP file; robots as messages | Foxglove, Lichtblick |
//!
//! This crate only exports; `rollwalk_robot::urdf` imports. Functions return texts, and equal robots or plans give equal texts.
//!
//! ```
//! use rollwalk_robot::Robot;
//!
//! let text = std::fs::read_to_string("../../shipped/robots/agilebot.toml")?;
//! let (robot, parts) = Robot::with_parts_from_toml("agilebot.toml", &text)?;
//! assert!(rollwalk_interchange::urdf(&robot, &parts)?.contains("<robot name="));
//! assert!(rollwalk_interchange::mjcf(&robot, &parts)?.contains("<mujoco model="));
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

#![warn(missing_docs)]

mod bodies;
pub mod foxglove;
mod mjcf;
mod motion_data;
mod npz;
mod ros2_control;
mod trajectory;
mod urdf;
mod xml;

pub use bodies::joint_names;
pub use mjcf::{mjcf, motion};
pub use motion_data::motion_data;
pub use ros2_control::{MOCK, controllers, urdf_with_control};
pub use trajectory::trajectory;
pub use urdf::urdf;
