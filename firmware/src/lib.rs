//! Plays a motion library on the controller: player, motion graph, safety state machine.
//!
//! ```text
//! link frames ──> Controller ──> link frames
//!                  │  safety: what may happen         (pure state machine)
//!                  │  motion: what the actuators do   (align, player ─> limiter ─> actuators)
//!                  └─ store:  where the library is
//! ```
//!
//! Sans-IO: frames and the time go in, frames come out. No clock, no allocation, no `unsafe`, no
//! panic whatever comes in. What it does when is told in `docs/playback-and-safety.md`.
#![no_std]
#![forbid(unsafe_code)]

pub mod actuators;
pub mod align;
mod controller;
pub mod hermite;
pub mod limiter;
mod motion;
pub mod player;
pub mod safety;
mod settings;
pub mod store;
pub mod walk;

pub use controller::{Controller, Refusal};
pub use settings::{Settings, SettingsError};
