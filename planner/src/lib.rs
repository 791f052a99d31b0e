//! Trajectory optimisation for robots with legs and wheels (thesis ch. 2).
//!
//! Data flow: robot + [`motion::Motion`] → optimise → [`plan::Plan`] → sampled at 60 Hz → motion library.
//! A pure library: no clock, no file access, no threads, so that it also builds for the browser.

pub mod motion;
pub mod plan;
