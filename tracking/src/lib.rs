//! A controller that tracks a motion with the whole body: the measured state and what is planned for this moment in, setpoints
//! of all motors out; and an estimator of that state. No clock, no I/O, no memory taken once it is made.
//!
//! | module | is |
//! |---|---|
//! | [`estimator`] | the state from IMU, encoders and contacts |
//! | [`mod@reference`] | what is planned for a moment |
//! | [`tasks`] | what a tick wants of accelerations and ground forces, as weighted squares |
//! | [`tracker`] | the tick: inverse dynamics as a quadratic program |
//! | `quadratic` | a solver of small dense quadratic programs |
//!
//! The caller has the plan and the sensors: `rollwalk-simulate`, with the simulated world.

pub mod estimator;
mod quadratic;
pub mod reference;
pub mod tasks;
pub mod tracker;

pub use estimator::{Estimator, Sensors, Untrusted};
pub use quadratic::Unsolved;
pub use reference::Reference;
pub use tracker::{Setpoint, Tracker};
