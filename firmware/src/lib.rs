//! Plays a motion library on the controller: player, motion graph, safety state machine.
//!
//! ```text
//! link frames ──> Controller ──> link frames
//!                  │  messages: what was said, and the answer  (gate: once, in order, in time)
//!                  │  link:     what is to be said, and when
//!                  │  safety:   what may happen                (pure state machine)
//!                  │  motion:   what the actuators do          (align or walk ─> player, then
//!                  │                                            limiter ─> actuators' mailboxes)
//!                  │  tuning:   gains and limits, set and kept
//!                  │  journal:  what happened, for whoever asks later
//!                  └─ transfer: the library, in its store
//! ```
//!
//! Sans-IO: frames and the time go in, frames come out. No clock, no allocation, no `unsafe`, no
//! panic whatever comes in. What it does when is told in `docs/playback-and-safety.md`.
#![no_std]
#![forbid(unsafe_code)]

mod actuators;
mod align;
mod bus_watch;
mod controller;
mod gate;
pub mod hal;
mod hermite;
mod journal;
pub mod limiter;
mod link;
mod messages;
mod motion;
mod parameters;
pub mod periods;
pub mod player;
pub mod safety;
mod settings;
pub mod store;
mod tilt;
mod transfer;
mod tuning;
pub mod walk;

pub use actuators::load;
pub use controller::Controller;
pub use rollwalk_protocol::actuators::bus::{self, Bus, Buses};
pub use rollwalk_protocol::serial::BusState;
pub use settings::{Settings, SettingsError};
