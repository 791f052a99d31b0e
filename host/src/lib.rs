//! The host's end of the link: sessions, consoles and tools for a controller, over any bus.
//!
//! | module | is |
//! |---|---|
//! | [`session`] | blocking procedures: connect, flash, arm, select motions, stop |
//! | [`dbc`] | every frame signal by signal, and as a DBC file |
//! | [`decode`] | frames as named signals, for logs |
//! | [`joints`] | joints over time, measured and planned, from frames |
//! | [`telemetry`] | telemetry files for Foxglove |
//! | [`traces`] | motors over time, from telemetry files and logs of buses |
//! | [`authentication`] | sessions with a controller that obeys only hosts with its key |
//! | [`key_file`] | files with keys |
//! | [`client`] | the protocol without clock or bus: frames and time in, frames out |
//! | [`operator`] | the logic of a console: intents, frames and time in, frames and a view out |
//! | [`stream`] | setpoints that a host streams: frames in, messages out |
//! | [`discover`], [`listener`] | controllers on the link; other hosts of a controller |
//! | [`catalog`] | names for the numbers of a library |
//! | [`actuators`] | buses and servos of a robot, and the words that faults have on each kind of bus |
//! | [`doctor`] | diagnosis of a robot, and how to clear its faults |
//! | [`transfer`] | transfer of a library: answers in, requests out |
//! | [`describe`] | states, events and faults in words, and what to do next |
//! | [`refusal`] | the controller's refusals in sentences |
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
pub mod client;
pub mod dbc;
pub mod decode;
pub mod describe;
pub mod discover;
pub mod doctor;
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
