//! The simulator as other crates use it: one binary, one module per subject.

mod bounces;
mod closed_forms;
mod inverse;
mod robots;
mod sensitivities;
mod soft;
mod strings;
mod tori;
mod two_balls;
