//! The planner as other crates use it: one binary, one module per subject.

mod choreography;
mod clearance;
mod diagnosis;
mod ground;
mod layers;
mod motion_files;
mod optimise;
mod receding;
mod refine;
mod robots;
mod start;
mod stepping;
