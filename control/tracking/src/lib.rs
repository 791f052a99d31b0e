//! A controller that tracks a motion with the whole body: the measured state and what is planned for this moment in, setpoints
//! of all motors out; and an estimator of that state. No clock, no I/O, no memory taken once it is made.
//!
//! | module | is |
//! |---|---|
//! | [`absence`] | how long something is missing that comes and goes |
//! | `sensors` | readings of a tick |
//! | `plausible` | what a robot in order can measure |
//! | [`estimator`] | the state from IMU, encoders and contacts |
//! | [`mod@reference`] | what is planned for a moment |
//! | `contacts` | which end effectors bear the robot |
//! | `recovery` | whether the robot is on its plan, and where its plan lies |
//! | [`model`] | the robot near its plan as a linear system |
//! | [`gains`] | the best feedback for it, computed before the plan is played |
//! | `correction` | what errors ask for by these gains |
//! | [`tasks`] | what a tick wants of accelerations and ground forces, as weighted squares |
//! | [`tracker`] | the tick: inverse dynamics as a quadratic program |
//! | `quadratic` | a solver of small dense quadratic programs |
//!
//! The caller has the plan and the sensors: `rollwalk-simulate`, with the simulated world.
//!
//! ```
//! use nalgebra::{Isometry3, Vector3};
//! use rollwalk_multibody::{State, Tree};
//! use rollwalk_tracking::{Reference, Tracker, tasks::Weights};
//!
//! let text = std::fs::read_to_string("../../shipped/robots/agilebot.toml")?;
//! let robot = rollwalk_robot::Robot::from_toml("agilebot.toml", &text)?;
//! let tree = Tree::new(&robot).with_spinning_wheels(|_| 1e-6).with_armature();
//! // It stands as planned, and each end effector bears its part.
//! let feet = robot.end_effectors.len();
//! let part_n = tree.total_mass_kg() * 9.806_65 / feet as f64;
//! let reference = Reference {
//!     time_s: 0.0,
//!     world_from_ground: Isometry3::identity(),
//!     state: State::nominal(&tree),
//!     acceleration: vec![0.0; tree.dofs()],
//!     stands: vec![true; feet],
//!     force_n: vec![Vector3::z() * part_n; feet],
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

pub use estimator::{Estimator, Untrusted};
pub use gains::Gains;
pub use reference::Reference;
pub use sensors::Sensors;
pub use tracker::{NoSetpoints, Setpoint, Tracker};
