//! A controller that tracks a motion with the whole body: the measured state and what is planned for this moment in, setpoints
//! of all motors out; and an estimator of that state. No clock, no I/O, no memory taken once it is made.
//!
//! | module | is |
//! |---|---|
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

mod contacts;
mod correction;
pub mod estimator;
pub mod gains;
pub mod model;
mod quadratic;
mod recovery;
pub mod reference;
pub mod tasks;
pub mod tracker;

pub use estimator::{Estimator, Sensors, Untrusted};
pub use gains::Gains;
pub use quadratic::Unsolved;
pub use reference::Reference;
pub use tracker::{Setpoint, Tracker};
