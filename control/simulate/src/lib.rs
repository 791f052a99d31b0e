//! Simulation of plans: a simulated robot plays a plan in open or closed loop, and the result is compared with the plan (thesis
//! sec. 2.6.4).
//!
//! | module | contents |
//! |---|---|
//! | [`script`] | start state of a plan, and control law of each motor at any time |
//! | [`closed_loop`] | tracking of a plan in any world, from measurements to control laws |
//! | [`sequence`] | tracking of several plans, one after the other |
//! | `balance` | rest of a robot that balances on two wheels |
//! | `follower` | one tick of a plan or of a sequence |
//! | `tick` | measurements, timing and set-points of a tick |
//! | `safe_stop` | stop of a robot that can no longer be tracked |
//! | [`control`] | set-points of the plan for the servos in open loop, or a controller with feedback |
//! | [`run`] | simulation of a plan in a [`rollwalk_physics::World`], period by period |
//! | [`sensors`] | simulated IMU, encoders and contact switches, with noise and faults |
//! | [`elevation`] | simulated sensor of an elevation map, with noise, holes and delay |
//! | [`outcome`] | displacement, turn, falls, slip and forces of a run |
//! | [`log`] | table of a run, with a row for each step |
//! | [`identify`] | identification of friction, gains and other parameters from a recorded run |
//! | [`retarget`] | corrections of set-points, so that a robot with soft servos follows its plan |
//! | [`steered`] | steering of a simulated robot as by a joystick, with horizons planned from its measured state |
//! | [`judgement`] | comparison of the displacement with the planned one |
//! | [`verdict`] | pass or fail of a motion, from short runs on contacts of several stiffnesses |
//!
//! This crate simulates neither bus nor controller; `rollwalk-sim-host` does.
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

mod balance;
pub mod closed_loop;
pub mod control;
pub mod elevation;
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
pub use judgement::{ComponentDeviation, PlannedDisplacement};
pub use mismatch::Mismatch;
pub use outcome::{MotionFailure, RunOutcome};
pub use run::{Moment, Options, play};
pub use script::Script;
pub use sensors::{Noise, SensorFault, SensorFaultKind, SimulatedSensors};
pub use sequence::{Leg, Sequence};
pub use verdict::Verdict;
