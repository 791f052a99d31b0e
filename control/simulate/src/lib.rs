//! Plans in the simulated world: setpoints of a plan go to the servos of a robot on the ground, open loop, and what
//! becomes of it is measured against the plan (thesis sec. 2.6.4).
//!
//! | module | is |
//! |---|---|
//! | [`script`] | a plan as the state in which it begins and the control law of each motor at any time |
//! | [`closed_loop`] | a plan tracked in any world: measurements in, what motors do out |
//! | [`sequence`] | plans tracked one after the other |
//! | `follower` | a tick of either |
//! | `tick` | its measurements, timing and setpoints |
//! | `safe_stop` | how a robot comes to rest whose state is no longer known |
//! | [`control`] | setpoints of the plan for the servos, open loop, or a controller that sees the robot |
//! | [`run`] | the plan played in a [`rollwalk_physics::World`], period by period |
//! | [`sensors`] | what an IMU, encoders and contact switches of a simulated robot measure, with noise |
//! | [`outcome`] | ways, turns, falls, slip and forces |
//! | [`log`] | a run as a table, a line for each step |
//! | [`identify`] | numbers of a robot, such as friction and gains, from a recorded run
//! | [`retarget`] | corrections of setpoints with which a robot with soft servos follows its plan |
//! | [`steered`] | a robot that is steered as by a joystick, by horizons from its measured state |
//! | [`judgement`] | whether a way is what the plan says |
//! | [`verdict`] | whether a motion holds, from short runs on contacts of several stiffnesses |
//!
//! There is no bus and no controller in between: those are in `rollwalk-sim-host`.
//!
//! ```
//! use rollwalk_planner::{Options as PlanOptions, motion::Motion, optimise};
//! use rollwalk_simulate::{Control, Options, play};
//! use std::ops::ControlFlow;
//!
//! let read = |path: &str| std::fs::read_to_string(format!("../../shipped/{path}"));
//! let robot = rollwalk_robot::Robot::from_toml("car.toml", &read("robots/car.toml")?)?;
//! let motion = Motion::from_toml("car_drive.toml", &read("motions/car_drive.toml")?, &robot)?;
//! let plan = optimise(&robot, &motion, &PlanOptions::default(), &mut |_| ControlFlow::Continue(()));
//!
//! let outcome = play(&plan, &Options::new(Control::Servos, 500), |_| true)?;
//! assert!(outcome.holds(), "it drives half a metre");
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

#![warn(missing_docs)]

pub mod closed_loop;
pub mod control;
mod follower;
pub mod identify;
pub mod judgement;
pub mod log;
pub mod mismatch;
pub mod outcome;
pub mod retarget;
pub mod run;
mod safe_stop;
pub mod script;
pub mod sensors;
pub mod sequence;
pub mod steered;
mod tick;
pub mod verdict;

pub use closed_loop::Feedback;
pub use control::Control;
pub use judgement::{Astray, PlannedWay};
pub use mismatch::Mismatch;
pub use outcome::{Miss, Outcome};
pub use run::{Moment, Options, play};
pub use script::Script;
pub use sensors::{Noise, SensorFault, SensorFaultKind, SimulatedSensors};
pub use sequence::{Leg, Sequence};
pub use verdict::Verdict;
