//! Whole-body tracking controller and state estimator of a robot. From the measured state and the planned one, the controller
//! computes set-points of all motors. There is no clock and no I/O, and ticks do not allocate memory.
//!
//! | module | contents |
//! |---|---|
//! | [`absence`] | timer of an intermittent absence |
//! | `sensors` | sensor readings of a tick |
//! | `plausible` | plausible range of sensor readings |
//! | [`estimator`] | state estimation from IMU, encoders and contacts |
//! | [`mod@reference`] | planned state at a time |
//! | `contacts` | stance of the end effectors |
//! | `recovery` | recovery from pushes, and displacement of the plan |
//! | [`model`] | linear model of the robot near its plan |
//! | [`gains`] | optimal feedback for this model, computed before the plan is played |
//! | `correction` | corrections of forces and speeds by these gains |
//! | [`tasks`] | desired accelerations and ground forces of a tick, as weighted squares |
//! | [`tracker`] | tick of the controller: inverse dynamics as a quadratic program |
//! | `quadratic` | solver of small dense quadratic programs |
//!
//! The caller provides the plan and the sensors. `rollwalk-simulate` does so with the simulated world.
//!
//! ```
//! use nalgebra::{Isometry3, Vector3};
//! use rollwalk_multibody::{State, Tree};
//! use rollwalk_tracking::{Reference, Tracker, tasks::Weights};
//!
//! let text = std::fs::read_to_string("../../shipped/robots/agilebot.toml")?;
//! let robot = rollwalk_robot::Robot::from_toml("agilebot.toml", &text)?;
//! let tree = Tree::new(&robot).with_spinning_wheels(|_| 1e-6).with_armature();
//! // The robot stands as planned, and each end effector carries an equal part of its weight.
//! let feet = robot.end_effectors.len();
//! let part_n = tree.total_mass_kg() * 9.806_65 / feet as f64;
//! let reference = Reference {
//!     time_s: 0.0,
//!     world_from_ground: Isometry3::identity(),
//!     state: State::nominal(&tree),
//!     acceleration: vec![0.0; tree.dofs()],
//!     stands: vec![true; feet],
//!     force_n: vec![Vector3::z() * part_n; feet],
//!     ground_height_m: vec![0.0; feet],
//!     ground_normal: vec![Vector3::z(); feet],
//! };
//! let mut tracker = Tracker::new(tree, Weights::default(), 0.002);
//! let setpoints = tracker.tick(&reference, &reference.state, &reference.stands)?;
//! assert_eq!(setpoints.len(), robot.channels().count());
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

#![warn(missing_docs)]

pub mod absence;
mod contacts;
mod correction;
pub mod estimator;
pub mod gains;
pub mod model;
mod plausible;
mod quadratic;
mod recovery;
pub mod reference;
mod sensors;
pub mod tasks;
pub mod tracker;

pub use estimator::{EstimateError, Estimator};
pub use gains::Gains;
pub use reference::Reference;
pub use sensors::Sensors;
pub use tracker::{NoSetpoints, Setpoint, Tracker, balances};
