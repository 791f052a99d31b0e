//! Trajectory optimisation for robots with legs and wheels (thesis ch. 2).
//!
//! Data flow: robot + [`motion::Motion`] → optimise → [`plan::Plan`] → sampled at 60 Hz → motion library.
//! A pure library: no clock, no file access, no threads, so that it also builds for the browser.

mod coarse;
mod diagnose;
pub mod export;
pub mod families;
mod formulation;
mod guess;
pub mod library;
pub mod library_file;
mod model;
pub mod motion;
mod normal;
mod optimise;
mod penalty;
pub mod plan;
pub mod plot;
mod problem;
mod replan;
pub mod report;
mod rows;
pub mod sample;
mod solver;
pub mod start;
mod state;
mod swing;
mod terms;
#[cfg(test)]
mod test_plans;
#[cfg(test)]
mod test_robots;
mod transition;
mod variables;

pub use optimise::{Options, Solution, optimise, optimise_solution};
pub use problem::Weights;
pub use replan::{ReplanError, replan};
pub use solver::{ACCEPTED_LEVEL, Method, Progress, Settings};
pub use transition::{TransitionError, optimise_transition};
