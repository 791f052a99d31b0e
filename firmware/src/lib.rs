//! Plays a motion library on the controller: player, motion graph, safety state machine.
#![no_std]
#![forbid(unsafe_code)]

pub mod actuators;
pub mod align;
pub mod hermite;
pub mod limiter;
pub mod player;
pub mod safety;
pub mod store;
pub mod walk;
