//! Trajectory optimisation for robots with legs and wheels (thesis ch. 2).
//!
//! Data flow: robot + [`motion::Motion`] → optimise → [`plan::Plan`] → sampled at 60 Hz → motion library.
//! A pure library: no clock, no file access, no threads, so that it also builds for the browser.

pub mod export;
pub mod formulation;
pub mod guess;
pub mod library;
pub mod library_file;
pub mod model;
pub mod motion;
mod normal;
mod optimise;
mod penalty;
pub mod plan;
pub mod plot;
pub mod problem;
pub mod report;
pub mod rows;
pub mod sample;
pub mod solver;
pub mod state;
mod swing;
pub mod terms;
#[cfg(test)]
mod test_plans;
#[cfg(test)]
mod test_robots;
mod transition;
pub mod variables;

pub use optimise::{Options, optimise};
pub use transition::{TransitionError, optimise_transition};
