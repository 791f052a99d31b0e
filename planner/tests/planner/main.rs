//! Tests of the planner through its public interface: one binary, one module per subject.

mod choreography;
mod clearance;
mod diagnosis;
mod examples;
mod ground;
mod layers;
mod lying;
mod motion_files;
mod optimise;
mod ramps;
mod receding;
mod refine;
mod robots;
mod start;
mod stepping;
mod timing;
