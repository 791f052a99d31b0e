//! Trajectory optimisation for robots with legs and wheels (thesis ch. 2).
//!
//! Data flow: robot + [`motion::Motion`] → [`optimise`] → [`plan::Plan`] → sampled at 60 Hz → motion library. The crate uses no
//! clock, no files and no threads, so that it also builds for the browser.
//!
//! The optimiser consists of layers that use only layers before them (`tests/planner/layers.rs`): [`families`], `problem`,
//! `formulation`, `solve`, then `start` and `diagnose`, then `planning`. [`sensitivity`] computes derivatives of plans with
//! respect to the robot, and [`timing`] chooses free times by their prices.
//!
//! ```
//! use rollwalk_planner::{Options, motion::Motion, optimise, report::Report};
//! use std::ops::ControlFlow;
//!
//! let read = |path: &str| std::fs::read_to_string(format!("../shipped/{path}"));
//! let robot = rollwalk_robot::Robot::from_toml("car.toml", &read("robots/car.toml")?)?;
//! let motion = Motion::from_toml("car_drive.toml", &read("motions/car_drive.toml")?, &robot)?;
//!
//! let plan = optimise(&robot, &motion, &Options::default(), &mut |_| ControlFlow::Continue(()));
//! assert!((plan.samples.last().unwrap().com_m[0] - plan.samples[0].com_m[0] - 0.5).abs() < 1e-3);
//! // Every equation anew, from the plan alone.
//! let report = Report::new(&plan);
//! println!("{}", report.words(&plan.solve));
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

#![warn(missing_docs)]

pub mod building;
pub mod cone_program;
mod diagnose;
pub mod export;
pub mod families;
mod formulation;
mod growth;
pub mod json;
pub mod library;
pub mod library_file;
pub mod motion;
pub mod plan;
mod planning;
pub mod plot;
mod problem;
pub mod receding;
pub mod report;
pub mod sample;
pub mod sensitivity;
mod solve;
pub mod start;
#[cfg(test)]
mod test_plans;
#[cfg(test)]
mod test_robots;
pub mod timing;
pub mod torque;
pub mod whole_body;

pub use planning::{
    Batch, BatchPlan, Editing, Options, ReplanError, Search, Solution, Structures, TransitionError,
    candidates, optimise, optimise_solution, optimise_transition, replan, replan_finer,
    replan_solution,
};
pub use problem::Weights;
pub use solve::{ACCEPTED_LEVEL, Method, Progress, Settings};
