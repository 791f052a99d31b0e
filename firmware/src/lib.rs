//! Plays a motion library on the controller: player, motion graph, safety state machine.
//!
//! ```text
//! link frames ──> Controller ──> link frames
//!                  │  messages: decodes requests and answers    (gate: once, in order, unexpired;
//!                  │                                             authentication: from a host with the key)
//!                  │  link:     transmit scheduler of the host link
//!                  │  safety:   states, events, transitions     (pure state machine)
//!                  │  motion:   set-points of the actuators     (align, player or stream, then
//!                  │                                            limiter ─> actuators' mailboxes)
//!                  │  tuning:   gains and torque limits at run time
//!                  │  journal:  log of state changes and faults
//!                  └─ transfer: receives libraries into the store
//! ```
//!
//! Sans-IO: the caller passes frames and the time, and receives frames. The crate has no clock, no allocation and no `unsafe`,
//! and does not panic on any input. `docs/playback-and-safety.md` specifies the behaviour.
#![no_std]
#![forbid(unsafe_code)]
#![warn(missing_docs)]

mod actuators;
mod align;
mod authentication;
mod bus_watch;
mod channel_bits;
mod controller;
mod gate;
pub mod graph_cursor;
pub mod hal;
mod hermite;
mod imu;
mod journal;
pub mod limiter;
mod link;
mod motion;
mod parameters;
pub mod periods;
pub mod player;
pub mod safety;
mod settings;
pub mod store;
pub mod stream;
mod tilt;
pub mod track;
mod transfer;
mod tuning;
mod window;

pub use actuators::load;
pub use controller::Controller;
pub use rollwalk_protocol::actuators::bus::{self, Bus, Buses};
pub use rollwalk_protocol::serial::BusState;
pub use settings::{Settings, SettingsError};
