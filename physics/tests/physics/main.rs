//! Integration tests of the simulator: one binary, one module per subject.

mod bounces;
mod closed_forms;
mod examples;
mod inverse;
mod robots;
mod sensitivities;
mod soft;
mod strings;
mod tori;
mod two_balls;
