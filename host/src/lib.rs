//! Host's end of the link: sessions, consoles and tools for a controller, over any bus.
//!
//! | module | contents |
//! |---|---|
//! | [`session`] | blocking procedures: connect, flash, arm, select motions, stop |
//! | [`dbc`] | database of all frames and signals, also as a DBC file |
//! | [`decode`] | frames as named signals, for logs |
//! | [`joints`] | joints over time, measured and planned, from frames |
//! | [`telemetry`] | telemetry files for Foxglove, written from frames |
//! | [`traces`] | motors over time, from telemetry files and logs of buses |
//! | [`authentication`] | sessions with a controller that accepts only hosts with its key |
//! | [`key_file`] | files with keys |
//! | [`client`] | the protocol without clock or bus: receives frames and the time, returns frames |
//! | [`operator`] | the logic of a console: receives intents, frames and the time, returns frames and a view |
//! | [`stream`] | set-points that a host streams |
//! | [`discover`], [`listener`] | detection of controllers on the link, and of other hosts of a controller |
//! | [`catalog`] | names for the motions and channels of a library |
//! | [`actuators`] | buses and servos of a robot, and descriptions of faults for each kind of bus |
//! | [`doctor`] | diagnosis of a robot, and how to clear its faults |
//! | [`transfer`] | transfer of a library: receives answers, returns requests |
//! | [`describe`] | descriptions of states, events and faults, and advice |
//! | [`refusal`] | descriptions of the controller's refusals |
//!
//! ```
//! use rollwalk_host::session::Session;
//! use rollwalk_protocol::wire::Node;
//!
//! /// Flashes a library and plays the motion with code 2 for three seconds, on any bus with a controller.
//! fn play(bus: impl rollwalk_bus::link::LinkBus, node: Node, library: &[u8]) -> Result<(), Box<dyn std::error::Error>> {
//!     let mut session = Session::connect_alone(bus, node)?;
//!     session.flash(library, |progress| eprintln!("{} of {} bytes", progress.done, progress.total))?;
//!     session.arm()?;
//!     session.select(2)?;
//!     session.run_for(3_000_000)?;
//!     session.return_to_safe()?;
//!     session.disarm()?;
//!     Ok(())
//! }
//! ```

#![warn(missing_docs)]

pub mod actuators;
pub mod authentication;
pub mod catalog;
mod chunks;
pub mod client;
pub mod dbc;
pub mod decode;
pub mod describe;
pub mod discover;
pub mod doctor;
#[cfg(test)]
mod fixtures;
pub mod joints;
pub mod key_file;
pub mod listener;
pub mod operator;
pub mod refusal;
pub mod session;
pub mod stream;
pub mod telemetry;
pub mod traces;
pub mod tracking;
pub mod transfer;
